"""C3D (c3d.org): binary tracks with parameters, written by nearly all motion-capture systems.

A header of 512 bytes, a section of parameters in groups (:mod:`wingfit.importers.readers.c3d_parameters`), then for
each frame x, y, z and a fourth word for each point, and analogue samples. The numbers are 16-bit integers times
POINT:SCALE, or 32-bit floats if that scale is negative. A negative fourth word marks a point as invalid. POINT:UNITS,
POINT:RATE and, for the vertical axis of the screen, POINT:Y_SCREEN are stated in the file.

The reader is our own because a file that is cut off must be refused, and untrusted bytes must meet memory-safe code
(docs/decisions/0023-importers.md). It is tested against another library, ezc3d.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.importers.limits import MAX_TRACK_VALUES
from wingfit.importers.numbers import WORD
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, Stated
from wingfit.importers.readers.c3d_parameters import Binary, Parameters, read_parameters
from wingfit.importers.source import Source
from wingfit.records.array_types import Array, Mask
from wingfit.records.errors import check_most, fail
from wingfit.records.limits import MAX_MARKERS, MAX_ROWS

BLOCK = 512
_KEY = 0x50
# Model outputs that some programs store as points, but that are no positions.
_OTHER_KINDS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")


@dataclass(frozen=True)
class _Data:
    """Where the data are: ``offset`` in bytes, ``points`` and ``analogue`` samples in a frame, frames, first frame."""

    offset: int
    points: int
    analogue: int
    frames: int
    first: int
    floats: bool
    remarks: tuple[str, ...]


def recognises(source: Source) -> bool:
    """Return whether the first two bytes are those of a C3D file."""
    raw = source.raw
    return source.encoding is None and len(raw) > 2 and raw[1] == _KEY and 2 <= raw[0] < 128


def read(source: Source, given: Given) -> Raw:
    """Return the points of a C3D file; DatasetError says what is wrong with it."""
    raw, file = source.raw, source.file
    if len(raw) < 2 * BLOCK or raw[1] != _KEY:
        raise fail(file, len(raw), f"has {len(raw)} bytes and is no whole C3D file; it may be cut off: export it again")
    binary, parameters = read_parameters(raw, (raw[0] - 1) * BLOCK, file)
    scale = parameters.number("POINT", "SCALE", binary.real(raw, 12))
    if not np.isfinite(scale) or scale == 0:
        raise fail(f"{file}, POINT:SCALE", scale, f"is {scale:g}; it must be a number other than 0: export it again")
    data = _data(raw, binary, parameters, scale < 0, given, file)
    positions, invalid = _points(raw, binary, data, scale)
    labels = _labels(parameters, data.points)
    keep, remarks = _positions_only(parameters, labels)
    lines = np.arange(1, data.frames + 1)
    found = Raw([labels[m] for m in keep], positions[:, keep], lines, "frame", remarks=[*data.remarks, *remarks])
    found.invalid = invalid[:, keep]
    found.frames, found.first = np.arange(data.first, data.first + data.frames), 1
    _state(found, parameters, float(binary.real(raw, 20)), data)
    return found


def _data(raw: bytes, binary: Binary, parameters: Parameters, floats: bool, given: Given, file: str) -> _Data:
    points, analogue, start, end = (binary.word(raw, at) for at in (2, 4, 6, 8))
    used = parameters.number("POINT", "USED", points)
    if used != points:
        message = f"the header has {points} points, but POINT:USED is {used:g}; the file is damaged: export it again"
        raise fail(file, points, message)
    check_most(file, "has", points, MAX_MARKERS, "points", "export fewer markers")
    if points == 0:
        raise fail(file, 0, "has no points (markers), perhaps only analogue data; export the markers")
    block = binary.word(raw, 16) or int(parameters.number("POINT", "DATA_START", 0))
    offset, size = (block - 1) * BLOCK, (4 * points + analogue) * (4 if floats else 2)
    if not 0 < offset <= len(raw):
        raise fail(
            file, block, f"the data start at block {block}, beyond the end; the file is cut off: export it again"
        )
    first, stated = _stated_frames(parameters, start, end)
    remarks = list[str]()
    frames = _frames(stated, len(raw) - offset, size, given, file, remarks)
    check_most(file, "has", frames, MAX_ROWS, "frames", "cut the recording in parts")
    check_most(file, "has", frames * points * 3, MAX_TRACK_VALUES, "numbers", "export fewer markers")
    return _Data(offset, points, analogue, frames, first, floats, tuple(remarks))


def _stated_frames(parameters: Parameters, start: int, end: int) -> tuple[int, dict[str, int]]:
    """Return the number of the first frame, and the count of frames that each place of the file states.

    The header holds numbers up to 65535 (``start``, ``end``); longer recordings state theirs in TRIAL or POINT.
    """
    first, stated = start, {"the header": end - start + 1}
    low, high = (parameters.words("TRIAL", name) for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD"))
    if len(low) == len(high) == 2:
        first = low[0] + 65536 * low[1]
        stated["TRIAL"] = high[0] + 65536 * high[1] - first + 1
    count = parameters.number("POINT", "FRAMES", 0)
    if np.isfinite(count) and count:
        stated["POINT:FRAMES"] = int(count) % 65536 if count < 0 else int(count)
    long = parameters.number("POINT", "LONG_FRAMES", 0)
    if np.isfinite(long) and long:
        stated["POINT:LONG_FRAMES"] = int(long)
    return first, stated


def _frames(stated: dict[str, int], there: int, size: int, given: Given, file: str, remarks: list[str]) -> int:
    """Return the count of frames of ``size`` bytes, of which ``there`` bytes are in the file.

    If the places that state the count disagree, the one that fits the size of the file (to a block) is right.
    DatasetError if none fits, unless the user knows that the file is incomplete, which is added to ``remarks``.
    """
    counts = {n for n in stated.values() if n > 0}
    exact = {n for n in counts if 0 <= there - n * size < BLOCK}
    if len(exact) == 1:
        return exact.pop()
    whole = there // size
    listed = ", ".join(f"{place} {n}" for place, n in stated.items())
    what = f"states {listed} frames, but has data for {whole}"
    if given.incomplete and whole and counts:
        remarks.append(f"the file {what}; {min(whole, max(counts))} are imported")
        return min(whole, max(counts))
    cause = "it is cut off" if not counts or min(counts) > whole else "the counts are wrong, or the file is damaged"
    remedy = "export it again, or give --incomplete to import the frames that are stated and there"
    raise fail(file, whole, f"{what}: {cause}; {remedy}")


def _points(raw: bytes, binary: Binary, data: _Data, scale: float) -> tuple[Array, Mask]:
    """Return positions [T, M, 3] in the file's unit, and which are invalid [T, M]."""
    width = 4 * data.points + data.analogue
    count = data.frames * width
    values = binary.reals(raw, data.offset, count) if data.floats else binary.integers(raw, data.offset, count)
    points = values.reshape(data.frames, width)[:, : 4 * data.points].reshape(data.frames, data.points, 4)
    with np.errstate(invalid="ignore", over="ignore"):
        positions = points[..., :3].astype(np.float64) * (1.0 if data.floats else scale)
        positions[np.isnan(positions)] = WORD
        return positions, points[..., 3] < 0


def _labels(parameters: Parameters, points: int) -> list[str]:
    """Return the names of all points; LABELS holds 255 at most, and LABELS2, LABELS3, ... go on."""
    labels = list(parameters.texts("POINT", "LABELS"))
    number = 2
    while len(labels) < points and (more := parameters.texts("POINT", f"LABELS{number}")):
        labels += more
        number += 1
    return (labels + [""] * points)[:points]


def _positions_only(parameters: Parameters, labels: list[str]) -> tuple[list[int], list[str]]:
    """Return the indices of points that are positions, and remarks about those that are not."""
    keep, remarks = [*range(len(labels))], []
    for kind in _OTHER_KINDS:
        listed = {name for name in parameters.texts("POINT", kind) if name}
        left = [m for m in keep if labels[m] in listed]
        if left:
            remarks.append(f"not imported: {len(left)} points that are {kind.lower()} (POINT:{kind})")
            keep = [m for m in keep if m not in left]
    return keep, remarks


def _state(found: Raw, parameters: Parameters, header_rate: float, data: _Data) -> None:
    unit = next(iter(parameters.texts("POINT", "UNITS")), "")
    if unit:
        found.unit = Stated(unit, "POINT:UNITS")
    rates = {"POINT:RATE": parameters.number("POINT", "RATE", 0.0), "the header": header_rate}
    found.rates = [Stated(rate, where) for where, rate in rates.items() if np.isfinite(rate) and rate > 0]
    up = next(iter(parameters.texts("POINT", "Y_SCREEN")), "")
    if len(up) == 2 and up[0] in "+-" and up[1].upper() in "XYZ":
        found.up = Stated(up.upper(), "POINT:Y_SCREEN")
    if data.analogue:
        found.remarks.append(f"not imported: {data.analogue} analogue samples per frame")


READER = Reader("c3d", "C3D", recognises, read)
