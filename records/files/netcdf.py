"""Reads and writes a dataset as a NetCDF-4 file: text of ``dataset.yaml`` as an attribute, one group per recording.

Layout: root attributes ``format`` and ``dataset_yaml``; group ``recordings/<name>`` with ``time_s(time)`` and, NaN
where missing, ``position_m(time, marker, axis)`` with ``marker(marker)``, ``force_n(time, axis)`` with ``axis(axis)``,
or ``value(time, quantity)`` with ``quantity(quantity)``, the names of channels and inputs. Written with h5netcdf; read
with h5py, because an uploaded HDF5 file can link to other files of the server and every such link must be refused.

Sizes of items and chunks, and filters, are checked before anything is read, which limits the memory for a valid file. A
damaged or malicious one can still make the HDF5 library loop, crash or exhaust memory; so uploaded files are read only
by :mod:`wingfit.records.files.confined`.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO, NamedTuple

import h5netcdf
import h5py
import numpy as np

from wingfit.records import limits
from wingfit.records.array_types import Array
from wingfit.records.dataset import AnyDataset, AnyRecording
from wingfit.records.description.dataset_file import (
    DatasetFile,
    SeriesDatasetFile,
    VehicleDatasetFile,
    WingDatasetFile,
    model_of,
)
from wingfit.records.description.yaml_text import read_yaml, write_yaml
from wingfit.records.errors import DatasetError, Faults, check_most, fail, nearest, shown
from wingfit.records.files.assemble import assemble, check_markers, checked_description
from wingfit.records.files.folder import RECORDINGS
from wingfit.records.files.forces import AXES
from wingfit.records.files.parsed import Parsed
from wingfit.records.files.series_dataset import samples_of
from wingfit.records.files.series_table import Columns
from wingfit.records.files.table import Samples, too_much
from wingfit.records.limits import MAX_CHUNK_BYTES, MAX_DESCRIPTION_BYTES, MIB
from wingfit.records.series import Series

FORMAT = "wingfit dataset"
BLOCK = 2**20  # numbers
# Filters that come with h5py, each of which may be in a variable's pipeline once.
FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32, h5py.h5z.FILTER_LZF}
_BROKEN = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, IndexError, OverflowError)


class Limit(NamedTuple):
    """Limits: ``left`` numbers may still be read, of ``most`` in the file; ``storage``: check chunks and filters."""

    left: int
    most: int
    storage: bool


class _Layout(NamedTuple):
    """Variables of a recording: ``values`` [T, C, ...] with ``inner`` dimensions, ``labels`` [C], at most ``most``."""

    labels: str
    values: str
    inner: tuple[int, ...]
    fitting: str
    most: int


_LAYOUTS: dict[type[DatasetFile], _Layout] = {
    WingDatasetFile: _Layout("marker", "position_m", (3,), "[T], [M] and [T, M, 3]", limits.MAX_MARKERS),
    VehicleDatasetFile: _Layout("axis", "force_n", (), "[T], [C] and [T, C]", limits.MAX_MARKERS),
    SeriesDatasetFile: _Layout("quantity", "value", (), "[T], [C] and [T, C]", 2 * limits.MAX_QUANTITIES),
}


def write_netcdf(dataset: AnyDataset) -> bytes:
    """Return the bytes of a NetCDF-4 file with the dataset; DatasetError if the dataset violates the format."""
    text = write_yaml(checked_description(dataset))
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["dataset_yaml"] = text
        for recording in dataset.recordings:
            group = file.create_group(f"{RECORDINGS}/{recording.name}")
            _write_recording(group, recording)
    return buffer.getvalue()


def _write_recording(group: Any, recording: AnyRecording) -> None:
    labels: tuple[str, ...]
    dimensions: tuple[str, ...]
    if isinstance(recording, Series):
        samples = samples_of(recording)
        dimensions, labels, name, unit, data = ("time", "quantity"), samples.quantities, "value", "", samples.values
    elif recording.kind == "forces":
        dimensions, labels, name, unit, data = ("time", "axis"), recording.forces, "force_n", "N", recording.values
    else:
        dimensions, labels = ("time", "marker", "axis"), recording.markers
        name, unit, data = "position_m", "m", recording.positions
    group.dimensions = dict(zip(dimensions, data.shape, strict=True))
    of = dimensions[1]
    group.create_variable(of, (of,), dtype=h5py.string_dtype(), data=np.array(labels, dtype=object))
    group.create_variable("time_s", ("time",), data=recording.times).attrs["units"] = "s"
    values = group.create_variable(name, dimensions, data=data, fillvalue=np.nan, compression="gzip", shuffle=True)
    if unit:
        values.attrs["units"] = unit


def read_netcdf(data: bytes, label: str, *, plausible: bool = True) -> AnyDataset:
    """Read a dataset from the bytes of a trusted NetCDF-4 file, called ``label`` in messages.

    Without ``plausible``, units and sampling are not checked.
    """
    return parse_netcdf(io.BytesIO(data), label, plausible=plausible)[0]


def parse_netcdf(
    opened: BinaryIO, label: str, most: int = limits.MAX_VALUES, *, storage: bool = True, plausible: bool = True
) -> tuple[AnyDataset, Parsed]:
    """Read a NetCDF-4 file of at most ``most`` numbers; return the dataset, and its text and samples as stored.

    ``label`` names the file in messages. ``storage``: refuse chunks, filters and fixed-length texts by which a small
    file needs much memory. DatasetError lists the errors.
    """

    def place(name: str) -> str:
        return f"{label}: {RECORDINGS}/{name}"

    with _damage(label), h5py.File(opened, "r") as file:
        text, samples = _attribute(file, "dataset_yaml", label), dict[str, Samples]()
        document = read_yaml(text, f"{label}: dataset_yaml")
        listed = _group(file, RECORDINGS, label)
        markers = document.names("wing", "markers")
        unlisted = sorted(set(listed) - set(document.names("recordings")))
        if unlisted:
            message = "this group is not listed in dataset_yaml; add it under recordings, or remove the group"
            raise fail(place(unlisted[0]), unlisted[0], message)

        def read(name: str, room: int) -> Samples:
            where = place(name)
            with _damage(where):
                group = _group(listed, name, where)
                model = model_of(document.data)
                known = Columns.of(document).names if model is SeriesDatasetFile else tuple(markers)
                samples[name] = _samples(group, where, _LAYOUTS[model], known, Limit(room, most, storage))
                return samples[name]

        at = "{}, time index {}".format
        dataset = assemble(document, read, place, lambda name, _, row: at(place(name), row), most, plausible=plausible)
    return dataset, Parsed(text, samples)


@contextmanager
def _damage(where: str) -> Iterator[None]:
    """Convert the exceptions that HDF5 raises on a damaged file to a DatasetError, which names the place ``where``."""
    try:
        yield
    except DatasetError:
        raise
    except _BROKEN as error:
        cause = shown(" ".join(str(error).split()))
        raise fail(where, None, f"not a readable NetCDF-4 file: {cause}; it may be cut off: write it again") from None


def _attribute(file: Any, name: str, label: str) -> bytes:
    if name not in file.attrs:
        message = f"attribute {name!r} is missing; it must hold the text of dataset.yaml (docs/formats.md)"
        raise fail(label, None, message)
    size = file.attrs.get_id(name).dtype.itemsize / MIB
    check_most(label, f"attribute {name!r} takes", size, MAX_DESCRIPTION_BYTES / MIB, "MiB", "put samples in groups")
    value = file.attrs[name]
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if not isinstance(value, (str, bytes)):
        raise fail(label, None, f"attribute {name!r} must be one text, the contents of dataset.yaml")
    return value.encode() if isinstance(value, str) else value


def _child(parent: Any, name: str, where: str, kind: type) -> Any:
    """Return the member ``name`` of the group ``parent``; DatasetError if missing, a link, or not of type ``kind``."""
    link = parent.get(name, getlink=True)
    if link is None:
        raise fail(where, name, f"{name!r} is missing; see docs/formats.md for the groups and variables")
    if not isinstance(link, h5py.HardLink):
        raise fail(where, name, f"{name!r} is a link; only data in the file itself are read: copy them in")
    child = parent[name]
    if not isinstance(child, kind):
        raise fail(where, name, f"{name!r} must be a {kind.__name__.lower()}; see docs/formats.md")
    return child


def _group(parent: Any, name: str, where: str) -> Any:
    return _child(parent, name, where, h5py.Group)


def _variable(group: Any, name: str, where: str) -> Any:
    variable = _child(group, name, where, h5py.Dataset)
    if variable.is_virtual or variable.external:
        raise fail(where, name, f"{name!r} stores its data in other files; copy them into this one")
    if variable.shape is None:
        raise fail(where, name, f"{name!r} has no dimensions and no data; see docs/formats.md for its shape")
    return variable


def _samples(group: Any, where: str, layout: _Layout, known: tuple[str, ...], limit: Limit) -> Samples:
    """Read the samples in ``group``; ``known`` are the names of the wing's markers, or those of a series' columns."""
    times, values, names = (_variable(group, each, where) for each in ("time_s", layout.values, layout.labels))
    frames = times.shape[0] if len(times.shape) == 1 else -1
    if len(names.shape) != 1 or values.shape != (frames, *names.shape, *layout.inner):
        shapes = (
            f"time_s {list(times.shape)}, {layout.labels} {list(names.shape)}, {layout.values} {list(values.shape)}"
        )
        raise fail(where, list(values.shape), f"shapes {shapes} do not fit; they must be {layout.fitting}")
    check_most(where, "", names.size, layout.most, f"entries of {layout.labels}", "remove some")
    _check_size(times, values, where, limit)
    found = _names(names, layout.labels, where, limit)
    instants, numbers = np.arange(frames), _numbers(values)
    if layout.labels == "marker":
        faults = Faults()
        check_markers(found, known, where, faults)
        faults.raise_any()
        return Samples(_numbers(times), numbers.reshape(frames, 3 * len(found)), instants, markers=found)
    if layout.labels == "quantity":
        _check_quantities(found, known, where)
        return Samples(_numbers(times), numbers, instants, quantities=found)
    axes = tuple(axis for axis in AXES if axis in found)
    if not axes or len(axes) != len(found):
        raise fail(where, ", ".join(found), f"axis is {', '.join(found) or 'empty'}; it must hold x, z, or both")
    ordered = np.ascontiguousarray(numbers[:, [found.index(axis) for axis in axes]])
    return Samples(_numbers(times), ordered, instants, forces=axes)


def _check_quantities(found: tuple[str, ...], known: tuple[str, ...], where: str) -> None:
    """Raise DatasetError unless ``found`` are the ``known`` names of channels and inputs, in any order."""
    faults = Faults()
    for index, name in enumerate(found):
        if name not in known:
            faults.add(where, name, f"no channel or input is called {name!r}; {nearest(name, known)}")
        elif name in found[:index]:
            faults.add(where, name, f"quantity {name!r} appears twice; keep one")
    for name in known:
        if name not in found:
            faults.add(where, name, f"quantity {name!r} is missing; add it (NaN where a channel was not recorded)")
    faults.raise_any()


def _numbers(variable: Any) -> Array:
    """Read all values of ``variable``, a few chunks at a time, since the library holds a copy of what it reads."""
    made, chunk = np.empty(variable.shape), (variable.chunks or (1,))[0]
    rows = max(1, BLOCK // max(1, math.prod((chunk, *variable.shape[1:])))) * chunk
    for start in range(0, len(made), rows):
        block = np.s_[start : start + rows]
        variable.read_direct(made, block, block)
    return made


def _check_size(times: Any, values: Any, where: str, limit: Limit) -> None:
    """Raise DatasetError if ``times`` or ``values`` are too large or of a wrong type, before memory is allocated."""
    check_most(where, "", times.size, limits.MAX_ROWS, "times", "cut the recording in parts")
    if times.size + values.size > limit.left:
        raise too_much(where, limit.most)
    for variable in (times, values):
        if variable.dtype.kind != "f" or variable.dtype.itemsize > 8:
            message = f"{variable.name} is of type {variable.dtype}; write 32- or 64-bit floating-point numbers"
            raise fail(where, str(variable.dtype), message)
        if limit.storage:
            _check_storage(variable, where)


def _check_storage(variable: Any, where: str) -> None:
    """Raise DatasetError if ``variable`` has chunks or filters by which a small file needs much memory."""
    chunk = math.prod(variable.chunks or ()) * variable.dtype.itemsize / MIB
    check_most(where, f"a chunk of {variable.name} takes", chunk, MAX_CHUNK_BYTES / MIB, "MiB", "write smaller chunks")
    pipeline = variable.id.get_create_plist()
    filters = [pipeline.get_filter(index)[0] for index in range(pipeline.get_nfilters())]
    if set(filters) - FILTERS or len(set(filters)) < len(filters):
        remedy = "pack it by deflate alone, once, or not at all"
        raise fail(where, str(filters), f"{variable.name} is packed by the HDF5 filters {filters}; {remedy}")


def _names(variable: Any, name: str, where: str, limit: Limit) -> tuple[str, ...]:
    if h5py.check_string_dtype(variable.dtype) is None:
        raise fail(where, str(variable.dtype), f"{name} is of type {variable.dtype}; it must hold text")
    if limit.storage:
        size = variable.dtype.itemsize
        check_most(where, f"each {name} takes", size, limits.MAX_NAME_BYTES, "bytes", "shorten the type")
        _check_storage(variable, where)
    return tuple(str(text) for text in variable.asstr()[:])
