"""Write a calibrated model in one of the formats in which it can be taken away."""

from __future__ import annotations

import io
import keyword
import re
import sys
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from wingfit.export.calibrated_model import AnyRig, CalibratedModel
from wingfit.export.model_file import model_json
from wingfit.export.python.rig_file import rig_file
from wingfit.export.python.vehicle_file import vehicle_file
from wingfit.export.python.wing_package import wing_package
from wingfit.export.tables import tables
from wingfit.records import Wing

ZIP = "application/zip"
REQUIRED = ("llvmlite", "numba", "numpy")  # names that an exported package must not have
FMU = "wingfit.export.fmu"
# Of all files in an archive, so that equal models give equal bytes.
EARLIEST = (1980, 1, 1, 0, 0, 0)


class FormatError(ValueError):
    """The model cannot be written in the requested format."""


@dataclass(frozen=True)
class ExportedFile:
    """A file to save: its ``name``, ``media_type`` and ``body``."""

    name: str
    media_type: str
    body: bytes


def exported(model: CalibratedModel, format_name: str) -> ExportedFile:
    """Return ``model`` as a file; FormatError for an unknown format, or one that does not fit the model."""
    if format_name not in WRITERS:
        raise FormatError(f"unknown format {format_name!r}; there are {', '.join(WRITERS)}")
    return WRITERS[format_name](model)


def stem(model: CalibratedModel) -> str:
    """Return the name of the model for files and Python packages: lower case letters, digits and underscores."""
    plain = re.sub(r"[^a-z0-9]+", "_", model.rig.name.lower()).strip("_") or "model"
    if not plain[0].isalpha():
        return f"model_{plain}"
    taken = keyword.iskeyword(plain) or plain in sys.stdlib_module_names or plain in REQUIRED
    return f"{plain}_model" if taken else plain


def archive(files: Mapping[str, str | bytes]) -> bytes:
    """Return a zip of ``files``, contents by path; equal contents give equal bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as target:
        for path, content in files.items():
            entry = zipfile.ZipInfo(path, EARLIEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            target.writestr(entry, content)
    return buffer.getvalue()


def _json(model: CalibratedModel) -> ExportedFile:
    return ExportedFile(f"{stem(model)}.json", "application/json", model_json(model).encode())


def _python(model: CalibratedModel) -> ExportedFile:
    name = stem(model)
    if isinstance(model.rig, Wing):
        files = {f"{name}/{path}": text for path, text in wing_package(model, name).items()}
        return ExportedFile(f"{name}.zip", ZIP, archive(files))
    text = rig_file(model) if isinstance(model.rig, AnyRig) else vehicle_file(model)
    return ExportedFile(f"{name}.py", "text/x-python", text.encode())


def _fmu(model: CalibratedModel) -> ExportedFile:
    if find_spec(FMU) is None or not hasattr(import_module(FMU), "write_fmu"):
        raise FormatError("this installation of wingfit writes no FMU: take the format python instead")
    with TemporaryDirectory(prefix="wingfit-fmu-") as folder:
        path = Path(folder) / f"{stem(model)}.fmu"
        import_module(FMU).write_fmu(model, path)
        return ExportedFile(path.name, "application/octet-stream", path.read_bytes())


def _tables(model: CalibratedModel) -> ExportedFile:
    if isinstance(model.rig, AnyRig):
        raise FormatError(f"rig {model.rig.name!r} is simulated by its own program: take the format python or json")
    return ExportedFile(f"{stem(model)}_tables.zip", ZIP, archive(dict(tables(model))))


WRITERS: Mapping[str, Callable[[CalibratedModel], ExportedFile]] = {
    "python": _python,
    "tables": _tables,
    "json": _json,
    "fmu": _fmu,
}
