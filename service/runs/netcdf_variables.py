"""Writes NetCDF-4 files by the CF conventions: every variable has a unit and a description.

Files are written in memory, because HDF5 aborts the process if the disk becomes full while it writes.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import h5netcdf
import h5py
import numpy as np
import numpy.typing as npt

from wingfit.service.storage.tables import DatasetRow, DiagnosisRow, RunRow
from wingfit.service.version import wingfit_version

MEDIA_TYPE = "application/x-netcdf"
CONVENTIONS = "CF-1.11"
NO_UNIT = "1"
FLAGS = {"unknown": -1, "no": 0, "yes": 1}

Dimensions = tuple[str, ...]


def made(write: Callable[[Any], None], attributes: dict[str, Any]) -> bytes:
    """Return the bytes of a NetCDF-4 file with global ``attributes``; ``write(root group)`` adds its contents."""
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        describe(file, {"Conventions": CONVENTIONS, **attributes})
        write(file)
    return buffer.getvalue()


def provenance(row: RunRow | DiagnosisRow, dataset: DatasetRow, model: str, exported_at: str) -> dict[str, Any]:
    """Return the global attributes that document where the data of a file come from.

    ``model``: what was calibrated, in words; ``exported_at``: RFC 3339 time.
    """
    version = wingfit_version()
    ended = [f"{row.finished_at} {row.state}"] if row.finished_at else []
    return {
        "source": f"wingfit {version}, {model}",
        "history": "\n".join([f"{row.created_at} submitted", *ended, f"{exported_at} exported by wingfit {version}"]),
        "id": row.id,
        "state": row.state,
        "dataset_id": row.dataset_id,
        "dataset_name": dataset.name,
        "dataset_sha256": dataset.sha256,
    }


def describe(what: Any, attributes: dict[str, Any]) -> None:
    """Set ``attributes`` (name to value) of ``what``, a group or a variable."""
    for name, value in attributes.items():
        what.attrs[name] = _storable(value) if isinstance(value, str) else value


def numbers(
    group: Any,
    name: str,
    dimensions: Dimensions,
    units: str,
    meaning: str,
    data: npt.ArrayLike | None = None,
    *,
    kind: str = "f8",
    **attributes: Any,
) -> Any:
    """Add a numeric variable to ``group`` and return it; NaN is the fill value of floats.

    ``meaning``: its description; ``data``: its values, None if the caller sets them later; ``kind``: numpy type code;
    ``attributes``: further attributes of the variable.
    """
    options: dict[str, Any] = {"fillvalue": np.nan} if kind.startswith("f") else {}
    if dimensions:
        options |= {"compression": "gzip", "shuffle": True}
    given = None if data is None else np.asarray(data, dtype=kind)
    variable = group.create_variable(name, dimensions, dtype=kind, data=given, **options)
    describe(variable, {"units": units, "long_name": meaning, **attributes})
    return variable


def flags(group: Any, name: str, dimension: str, meaning: str, data: Iterable[bool | None]) -> None:
    """Add a variable of flags to ``group``: yes, no, or unknown (None); ``meaning``: its description."""
    values = [FLAGS["unknown"] if one is None else int(one) for one in data]
    variable = numbers(group, name, (dimension,), NO_UNIT, meaning, values, kind="i1")
    stated = {"flag_values": np.array(list(FLAGS.values()), dtype=np.int8), "flag_meanings": " ".join(FLAGS)}
    describe(variable, stated)


def texts(group: Any, name: str, dimension: str, meaning: str, data: Iterable[str] | None = None) -> Any:
    """Add a variable of strings to ``group`` and return it; without ``data`` the caller sets its values later."""
    given = None if data is None else text_array(data)
    variable = group.create_variable(name, (dimension,), dtype=h5py.string_dtype(), data=given)
    describe(variable, {"units": NO_UNIT, "long_name": meaning})
    return variable


def text_array(data: Iterable[str]) -> npt.NDArray[np.object_]:
    """Return the strings as an array of objects, the type that h5netcdf stores."""
    return np.array([_storable(text) for text in data], dtype=object)


def curve(group: Any, values: Mapping[str, Any], time: Iterable[float], models: Mapping[str, str]) -> None:
    """Add to ``group`` the values over ``time`` (s) of one channel of a series, recorded and simulated.

    ``values``: the curve in JSON, with recording, channel, unit, recorded values, and those of the ``models`` (name to
    description), None where one could not be simulated.
    """
    describe(group, {"recording": values["recording"], "channel": values["channel"]})
    times = list(time)
    group.dimensions = {"time": len(times)}
    numbers(group, "time", ("time",), "s", "time", times)
    for name, meaning in {"recorded": "recorded values", **models}.items():
        if values[name] is not None:
            numbers(group, name, ("time",), values["unit"], meaning, or_nan(values[name]))


def or_nan(values: Iterable[float | None]) -> npt.NDArray[np.float64]:
    """Return ``values`` as an array of floats, with NaN for None."""
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _storable(text: str) -> str:
    return text.replace("\0", "\ufffd")  # HDF5 ends texts at a zero
