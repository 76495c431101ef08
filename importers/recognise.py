"""Chooses the reader of a file by its content."""

from __future__ import annotations

from wingfit.importers.options import ask
from wingfit.importers.raw import Reader
from wingfit.importers.readers import READERS, SPECIFIC, plain
from wingfit.importers.source import Source
from wingfit.records.errors import DatasetError, fail

# First bytes of files that people try, and what to do with them.
_OTHERS = (
    (b"PK\x03\x04", "a zip file or an Excel workbook", "unpack it, or save the sheet as CSV"),
    (b"\xd0\xcf\x11\xe0", "an old Office file, or a project of a capture program", "save it as CSV, TSV or C3D"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB file", "write the points as CSV (writetable)"),
    (b"\x1f\x8b", "a gzip file", "unpack it"),
    (b"CDF", "a NetCDF-3 file", "write the tracks as CSV"),
    (b"\x80\x04\x95", "a Python pickle", "write the tracks as CSV"),
    (b"RIFF", "a video or sound file", "track the markers first, and import the tracks"),
    (b"%PDF", "a PDF", "export the tracks as CSV"),
)


def recognise(source: Source, name: str | None) -> Reader:
    """Return the reader for ``source``; ``name`` is the format that the user gave, or None.

    DatasetError if the content is no known format, if several fit, or if it does not decide and no ``name`` is given.
    """
    if not source.raw:
        raise fail(source.file, 0, "the file is empty (0 bytes); export it again")
    if name is not None:
        reader = READERS[name]
        if source.encoding is None and not reader.recognises(source):
            raise fail(source.file, name, f"is binary and no {reader.title}; leave --format out, or export it again")
        return reader
    fitting = [reader for reader in SPECIFIC if reader.recognises(source)]
    if len(fitting) > 1:
        names = [reader.name for reader in fitting]
        listed = " or ".join(names)
        raise ask("format", source.file, listed, f"fits several formats; choose one: --format {listed}", names)
    if not fitting:
        if source.encoding is None:
            raise _unknown(source)
        return plain.READER
    if fitting[0].needs_name:
        reader = fitting[0]
        message = f"{reader.needs_name}, give --format {reader.name}"
        raise ask("format", source.file, reader.name, message, [reader.name])
    return fitting[0]


def _unknown(source: Source) -> DatasetError:
    for start, what, remedy in _OTHERS:
        if source.raw.startswith(start):
            return fail(source.file, what, f"is {what}, which is not read; {remedy}")
    known = ", ".join(reader.title for reader in READERS.values())
    return fail(source.file, None, f"is binary, and no format that is read ({known}); export it as one of these")
