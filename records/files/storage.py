"""Load and save datasets as a folder, a zip of it, or NetCDF; the first bytes of a file show its type."""

from __future__ import annotations

from pathlib import Path

from wingfit.records.dataset import AnyDataset
from wingfit.records.errors import check_most, fail, shown
from wingfit.records.files.archive import read_zip, write_zip
from wingfit.records.files.folder import read_folder, write_folder
from wingfit.records.files.netcdf import read_netcdf, write_netcdf
from wingfit.records.files.replace import replace_file
from wingfit.records.limits import MAX_ARCHIVE_BYTES, MIB

_ZIP = (b"PK\x03\x04", b"PK\x05\x06")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_OTHERS = {
    b"CDF": "NetCDF-3; write NetCDF-4 (for instance 'nccopy -k nc4 old.nc new.nc')",
    b"\x1f\x8b": "gzip; upload a zip",
    b"7z\xbc\xaf": "7z; upload a zip",
    b"Rar!": "RAR; upload a zip",
    b"BZh": "bzip2; upload a zip",
    b"\xfd7zXZ": "xz; upload a zip",
}


def load_dataset(path: str | Path, *, plausible: bool = True) -> AnyDataset:
    """Read the dataset in the folder, zip or NetCDF file ``path``; DatasetError lists its errors.

    ``plausible``: also refuse implausible units and sampling. :mod:`wingfit.checks` looks at the physics.
    """
    path = Path(path)
    if path.is_dir():
        return read_folder(path, plausible=plausible)
    if path.name == "dataset.yaml" and path.is_file():
        return read_folder(path.parent, plausible=plausible)
    try:
        _check_size(path.stat().st_size, str(path))
        return load_archive(path.read_bytes(), path.name, plausible=plausible)
    except OSError as error:
        raise fail(str(path), None, f"cannot be read: {error.strerror}; check the path") from None


def label_of(filename: str) -> str:
    """Return the name by which messages refer to an upload: ``filename`` without folders, shortened."""
    return shown(filename.replace("\\", "/").rpartition("/")[2]) or "upload"


def is_netcdf(data: bytes) -> bool:
    """Return whether ``data`` begins as an HDF5 file does; NetCDF-4 files are HDF5 files."""
    return data[: len(_HDF5)] == _HDF5


def load_archive(data: bytes, filename: str, *, plausible: bool = True) -> AnyDataset:
    """Read a dataset from the bytes of a zip or NetCDF file; ``filename`` is used in messages only.

    DatasetError lists its errors. For untrusted NetCDF files use :func:`wingfit.records.files.confined.convert_netcdf`.
    """
    label = label_of(filename)
    _check_size(len(data), label)
    if data.startswith(_ZIP):
        return read_zip(data, label, plausible=plausible)
    if is_netcdf(data):
        return read_netcdf(data, label, plausible=plausible)
    if not data:
        raise fail(label, None, "the file is empty; upload a zip of the dataset's folder, or NetCDF-4")
    found = next((name for magic, name in _OTHERS.items() if data.startswith(magic)), None)
    if found is None:
        found = "neither a zip nor NetCDF-4; zip the folder that holds dataset.yaml and recordings/"
    raise fail(label, data[:8].hex(" "), f"this is {found}")


def save_dataset(dataset: AnyDataset, path: str | Path) -> None:
    """Write ``dataset`` as zip (``.zip``), NetCDF (``.nc``) or folder (anything else).

    An existing file is replaced atomically; a folder must be new or empty. DatasetError if the dataset violates the
    format, so that a written dataset can always be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".zip":
        replace_file(path, write_zip(dataset))
    elif suffix == ".nc":
        replace_file(path, write_netcdf(dataset))
    else:
        write_folder(dataset, path)


def _check_size(size: int, label: str) -> None:
    check_most(label, "is", size / MIB, MAX_ARCHIVE_BYTES / MIB, "MiB", "split the dataset")
