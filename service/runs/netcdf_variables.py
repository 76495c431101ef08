"""NetCDF-4 with CF conventions: every variable has its unit and a description.

Files are written in memory: HDF5 aborts the process if a disk is full while it writes.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
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
    """The bytes of a NetCDF-4 file with global ``attributes``, whose contents ``write(root group)`` adds."""
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        describe(file, {"Conventions": CONVENTIONS, **attributes})
        write(file)
    return buffer.getvalue()


def provenance(row: RunRow | DiagnosisRow, dataset: DatasetRow, model: str, exported_at: str) -> dict[str, Any]:
    """Attributes that document the origin of a file."""
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
    """Set attributes of ``what``, a group or a variable."""
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
    """Add a numeric variable to ``group``; NaN is the fill value of floats. Without ``data`` it is filled later."""
    options: dict[str, Any] = {"fillvalue": np.nan} if kind.startswith("f") else {}
    if dimensions:
        options |= {"compression": "gzip", "shuffle": True}
    given = None if data is None else np.asarray(data, dtype=kind)
    variable = group.create_variable(name, dimensions, dtype=kind, data=given, **options)
    describe(variable, {"units": units, "long_name": meaning, **attributes})
    return variable


def flags(group: Any, name: str, dimension: str, meaning: str, data: Iterable[bool | None]) -> None:
    """Add a variable of flags to ``group``: yes, no, or unknown (None)."""
    values = [FLAGS["unknown"] if one is None else int(one) for one in data]
    variable = numbers(group, name, (dimension,), NO_UNIT, meaning, values, kind="i1")
    stated = {"flag_values": np.array(list(FLAGS.values()), dtype=np.int8), "flag_meanings": " ".join(FLAGS)}
    describe(variable, stated)


def texts(group: Any, name: str, dimension: str, meaning: str, data: Iterable[str] | None = None) -> Any:
    """Add a variable of strings to ``group``."""
    given = None if data is None else text_array(data)
    variable = group.create_variable(name, (dimension,), dtype=h5py.string_dtype(), data=given)
    describe(variable, {"units": NO_UNIT, "long_name": meaning})
    return variable


def text_array(data: Iterable[str]) -> npt.NDArray[np.object_]:
    """Strings as the object array that h5netcdf stores."""
    return np.array([_storable(text) for text in data], dtype=object)


def or_nan(values: Iterable[float | None]) -> npt.NDArray[np.float64]:
    """``values`` as an array, with NaN for None."""
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _storable(text: str) -> str:
    return text.replace("\0", "\ufffd")  # HDF5 ends texts at a zero
