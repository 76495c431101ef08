"""A dataset as one NetCDF-4 file: the text of ``dataset.yaml`` as an attribute, one group per recording.

Layout: root attributes ``format`` and ``dataset_yaml``; group ``recordings/<name>`` with ``time_s(time)``,
``position_m(time, marker, axis)``, NaN where missing, and ``marker(marker)``. Written with h5netcdf; read
with h5py, because an uploaded HDF5 file can point to other files of the server and every such pointer must be
refused.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import h5netcdf
import h5py
import numpy as np

from records.assemble import assemble, checked_description
from records.dataset import Dataset
from records.errors import DatasetError, fail, nearest, shown
from records.folder import TRACKS
from records.limits import MAX_MARKERS, MAX_ROWS
from records.tracks import Tracks, too_much
from records.yaml_text import read_yaml, write_yaml

FORMAT = "wingfit dataset"
_BROKEN = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, IndexError, OverflowError)


def write_netcdf(dataset: Dataset) -> bytes:
    """Pack the dataset as NetCDF-4."""
    text = write_yaml(checked_description(dataset))
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["dataset_yaml"] = text
        for recording in dataset.recordings:
            group = file.create_group(f"{TRACKS}/{recording.name}")
            group.dimensions = {"time": len(recording.times), "marker": len(recording.markers), "axis": 3}
            names = np.array(recording.markers, dtype=object)
            group.create_variable("marker", ("marker",), dtype=h5py.string_dtype(), data=names)
            group.create_variable("time_s", ("time",), data=recording.times).attrs["units"] = "s"
            positions = group.create_variable(
                "position_m",
                ("time", "marker", "axis"),
                data=recording.positions,
                fillvalue=np.nan,
                compression="gzip",
                shuffle=True,
            )
            positions.attrs["units"] = "m"
    return buffer.getvalue()


def read_netcdf(data: bytes, label: str) -> Dataset:
    """Read a dataset from the bytes of a NetCDF-4 file."""
    with _damage(label), h5py.File(io.BytesIO(data), "r") as file:
        document = read_yaml(_attribute(file, "dataset_yaml", label), f"{label}: dataset_yaml")
        listed = _group(file, TRACKS, label)
        markers = document.names("wing", "markers")
        unlisted = sorted(set(listed) - set(document.names("recordings")))
        if unlisted:
            message = "this group is not listed in dataset_yaml; add it under recordings, or remove the group"
            raise fail(f"{label}: {TRACKS}/{unlisted[0]}", unlisted[0], message)

        def read(name: str, room: int) -> Tracks:
            where = f"{label}: {TRACKS}/{name}"
            with _damage(where):
                return _tracks(_group(listed, name, where), where, markers, room)

        return assemble(
            document,
            read,
            lambda name: f"{label}: {TRACKS}/{name}",
            lambda name, _, row: _at(label, name, row),
        )


def _at(label: str, name: str, row: int) -> str:
    return f"{label}: {TRACKS}/{name}, time index {row}"


@contextmanager
def _damage(where: str) -> Iterator[None]:
    """Turn whatever HDF5 says about a broken file into a DatasetError."""
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
    value = file.attrs[name]
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if not isinstance(value, (str, bytes)):
        raise fail(label, None, f"attribute {name!r} must be one text, the contents of dataset.yaml")
    return value.encode() if isinstance(value, str) else value


def _child(parent: Any, name: str, where: str, kind: type) -> Any:
    """Member of a group, which must lie in this very file."""
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
        raise fail(where, name, f"{name!r} keeps its data in other files; copy them into this one")
    return variable


def _tracks(group: Any, where: str, known: list[str], room: int) -> Tracks:
    times, positions = _variable(group, "time_s", where), _variable(group, "position_m", where)
    names = _variable(group, "marker", where)
    frames, count = times.shape[0] if len(times.shape) == 1 else -1, names.size
    if positions.shape != (frames, count, 3) or names.shape != (count,):
        message = (
            f"shapes time_s {list(times.shape)}, marker {list(names.shape)}, position_m "
            f"{list(positions.shape)} do not fit; they must be [T], [M] and [T, M, 3]"
        )
        raise fail(where, list(positions.shape), message)
    # Declared shapes cost nothing to write: check them before memory is spent.
    if frames > MAX_ROWS or count > MAX_MARKERS:
        message = f"{frames} times and {count} markers; at most {MAX_ROWS} and {MAX_MARKERS} are read: cut it"
        raise fail(where, frames, message)
    if frames * (3 * count + 1) > room:
        raise too_much(where)
    for variable in (times, positions):
        if variable.dtype.kind != "f" or variable.dtype.itemsize > 8:
            message = f"{variable.name} is of type {variable.dtype}; write 32- or 64-bit floating-point numbers"
            raise fail(where, str(variable.dtype), message)
    if h5py.check_string_dtype(names.dtype) is None:
        raise fail(where, str(names.dtype), f"marker is of type {names.dtype}; it must hold text")
    markers = tuple(str(name) for name in names.asstr()[:])
    _check_names(markers, known, where)
    values = np.ascontiguousarray(positions[:], dtype=np.float64).reshape(frames, 3 * count)
    return Tracks(np.asarray(times[:], dtype=np.float64), markers, values, np.arange(frames))


def _check_names(markers: tuple[str, ...], known: list[str], where: str) -> None:
    for index, name in enumerate(markers):
        if name not in known:
            raise fail(where, name, f"no marker is called {name!r} in dataset_yaml; {nearest(name, known)}")
        if name in markers[:index]:
            raise fail(where, name, f"marker {name!r} stands twice; keep one")
