"""Reads and writes a dataset as a zip of its folder.

Zips are not trusted: sizes are checked before anything is read, and nothing is extracted to disk.
"""

from __future__ import annotations

import io
import re
import stat
import zipfile
import zlib
from collections.abc import Sequence

from wingfit.records.dataset import AnyDataset
from wingfit.records.errors import Faults, check_most, fail
from wingfit.records.files.folder import DESCRIPTION, contents, read_files
from wingfit.records.limits import MAX_COMPRESSION_RATIO, MAX_ENTRIES, MAX_EXPANDED_BYTES, MIB, RATIO_FREE_BYTES

# NotImplementedError is a RuntimeError.
_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, ValueError, OverflowError, IndexError)
_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
_JUNK = re.compile(r"(?:^|/)(?:__MACOSX/|\.DS_Store$|Thumbs\.db$|desktop\.ini$|\._)")
_EPOCH = (1980, 1, 1, 0, 0, 0)


def read_zip(data: bytes, label: str, *, plausible: bool = True) -> AnyDataset:
    """Read a dataset from the bytes of a zip, which holds the dataset's files or one folder with them.

    ``label`` names the zip in messages. DatasetError lists its errors; without ``plausible``, not implausible units.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except _BROKEN as error:
        raise fail(label, None, f"not a readable zip: {error}; it may be cut off: zip and upload again") from None
    _check_entries(archive.infolist(), len(data), label)
    files = [entry for entry in archive.infolist() if not entry.is_dir() and not _JUNK.search(entry.filename)]
    prefix = _prefix([entry.filename for entry in files])
    entries = {entry.filename.removeprefix(prefix): entry for entry in files}

    def read(name: str) -> bytes:
        try:
            return archive.read(entries[name])
        except _BROKEN as error:
            raise fail(f"{label}: {name}", None, f"damaged in the zip: {error}; zip and upload again") from None

    return read_files(label, list(entries), read, plausible=plausible)


def write_zip(dataset: AnyDataset) -> bytes:
    """Return the bytes of a zip of the dataset; the same dataset gives the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in sorted(contents(dataset).items()):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.create_system = 3
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED, 6)
    return buffer.getvalue()


def _check_entries(entries: Sequence[zipfile.ZipInfo], packed: int, label: str) -> None:
    check_most(label, "has", len(entries), MAX_ENTRIES, "entries", "is this the right file?")
    expanded = sum(entry.file_size for entry in entries)
    check_most(label, "unpacks to", expanded / MIB, MAX_EXPANDED_BYTES / MIB, "MiB", "split it")
    if expanded > RATIO_FREE_BYTES:
        remedy = "zip with less compression, or upload NetCDF"
        check_most(label, "unpacks to", expanded / packed, MAX_COMPRESSION_RATIO, "times its size", remedy)
    faults, seen = Faults(), set[str]()
    for entry in entries:
        problem = _entry_problem(entry) or ("appears twice in the zip; keep one" if entry.filename in seen else None)
        if problem:
            faults.add(f"{label}: {entry.filename!r}", entry.filename, problem)
        seen.add(entry.filename)
    faults.raise_any()


def _entry_problem(entry: zipfile.ZipInfo) -> str | None:
    # zipfile cuts a name at its first NUL and replaces backslashes; orig_filename is the stored name.
    name = entry.orig_filename
    if "\0" in name or "\\" in name:
        return "a name with a backslash or NUL; zip again with '/' between folder and file"
    if name.startswith("/") or re.match(r"[A-Za-z]:", name) or ".." in name.split("/"):
        return "a path that leads out of the archive; zip the dataset's folder, without '..' or leading '/'"
    if stat.S_ISLNK(entry.external_attr >> 16):
        return "a symbolic link; zip the file itself"
    if entry.flag_bits & 0x1:
        return "encrypted; zip again without a password"
    if entry.compress_type not in _METHODS:
        return f"packed by method {entry.compress_type}; zip again with the usual 'deflate'"
    return None


def _prefix(names: Sequence[str]) -> str:
    """Return ``folder/`` if all files ``names`` are in one folder with dataset.yaml, else the empty string."""
    folders = {name.partition("/")[0] for name in names}
    single = f"{folders.pop()}/" if len(folders) == 1 else ""
    return single if f"{single}{DESCRIPTION}" in names else ""
