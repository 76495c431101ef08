"""Reads one file: size, format, reader, and the user's statements."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from wingfit.importers.inspection import Inspection
from wingfit.importers.limits import MAX_TRACK_FILE_BYTES
from wingfit.importers.options import Decimal, Given
from wingfit.importers.raw import Raw, Reader
from wingfit.importers.readers import READERS
from wingfit.importers.recognise import recognise
from wingfit.importers.resolve import resolve
from wingfit.importers.source import open_source
from wingfit.importers.tracks import ImportedTracks
from wingfit.records.errors import DatasetError, check_most, fail
from wingfit.records.limits import MIB


def import_tracks(
    path: str | PathLike[str],
    *,
    unit: str | None = None,
    rate_hz: float | None = None,
    axes: str | None = None,
    format: str | None = None,  # noqa: A002  # as on the command line
    time_unit: str | None = None,
    decimal: Decimal = "point",
    columns: str | None = None,
    rows: str | None = None,
    keep_zeros: bool = False,
    keep_unlabelled: bool = False,
    incomplete: bool = False,
    markers: str | None = None,
    repeated: str | None = None,
) -> ImportedTracks:
    """Read the marker tracks in a file of a motion-capture system or digitiser, whose format its content shows.

    Args:
        path: the file.
        unit: of positions: m, cm, mm, um, in or ft; needed if the file does not state it.
        rate_hz: frames per second; needed if the file states neither a rate nor times.
        axes: where the axes of the file point: "x aft, y out, z up" for the wing's frame of a dataset,
            "x nose, y right, z down" for body axes; without it, positions stay in the axes of the file.
        format: name of the format, if the content fits several.
        time_unit: of a column of times that does not state it: s, ms or us.
        decimal: "comma" if a text file has decimal commas.
        columns: which columns a plain table has, if their names do not show it: "time=t; tip=a,b,c".
        rows: which rows of a plain table are read: "sequence=3,side=left".
        keep_zeros: positions that are exactly zero on all axes are seen; by default they are gaps.
        keep_unlabelled: import markers that the capture program did not identify, too.
        incomplete: import the frames that are there if the file states another count of frames.
        markers: only these markers: "tip,root"; ``*`` stands for any letters: "right_*".
        repeated: if rows have the same time: "gaps" merges them, with a gap where they differ; "first" keeps the first.

    Returns:
        The tracks in metres and seconds, with what was stated by whom, gaps by cause, and remarks.

    Raises:
        DatasetError: lists what is wrong with the file, which options are missing, or which contradict the file.

    """
    given = Given(
        unit, rate_hz, axes, format, time_unit, decimal, columns, rows, keep_zeros, keep_unlabelled, incomplete,
        markers, repeated,
    )  # fmt: skip
    place = Path(path)
    try:
        size = place.stat().st_size
        if not place.is_file():
            what = "a folder; name the files in it" if place.is_dir() else "no regular file; copy it to one"
            raise fail(place.name, str(place), f"is {what}")
        check_most(place.name, "has", size / MIB, MAX_TRACK_FILE_BYTES / MIB, "MiB", "cut the recording in parts")
        raw = place.read_bytes()
    except OSError as error:
        raise fail(place.name, str(place), f"cannot be read: {error.strerror or error}; check the path") from None
    return import_bytes(raw, place.name, given)


def import_bytes(raw: bytes, file: str, given: Given) -> ImportedTracks:
    """Return the tracks in the file with the bytes ``raw``, called ``file`` in messages; errors as in import_tracks."""
    found = inspect_bytes(raw, file, given)
    if found.error:
        raise found.error
    assert found.tracks is not None  # noqa: S101  # for the type checker
    return found.tracks


def inspect_bytes(raw: bytes, file: str, given: Given) -> Inspection:
    """Return what is understood of the file, and what is missing or wrong; arguments as in import_bytes."""
    found = Inspection(file)
    try:
        given.check([*READERS])
        check_most(file, "has", len(raw) / MIB, MAX_TRACK_FILE_BYTES / MIB, "MiB", "cut the recording in parts")
        found.reader, found.raw = _read(raw, file, given)
        found.tracks = resolve(found.raw, found.reader, given, file)
    except DatasetError as error:
        # Without its traceback, whose frames hold the file: it would stay in memory until garbage is collected.
        found.error = DatasetError(error.errors, error.count)
    return found


def _read(raw: bytes, file: str, given: Given) -> tuple[Reader, Raw]:
    source = open_source(raw, file)
    reader = recognise(source, given.format)
    for option, value in (("--columns", given.columns), ("--rows", given.rows)):
        if value is not None and reader.name != "plain":
            message = f"is for plain tables, but {file} is {reader.title}; leave it out, or add --format plain"
            raise fail(option, value, message)
    contents = reader.read(source, given)
    if source.encoding and not raw.rstrip(b"\0").endswith((b"\n", b"\r")):
        contents.remarks.append("the last line has no line end; if the file was cut off, its last number is not whole")
    return reader, contents
