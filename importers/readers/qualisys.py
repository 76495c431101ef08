"""TSV of Qualisys Track Manager, three-dimensional.

Each line of the header is a word in capitals and its values, separated by tabs: NO_OF_FRAMES, NO_OF_MARKERS, FREQUENCY
(or EXT for an external clock), DATA_INCLUDED (3D), MARKER_NAMES and more. A line with names of columns may follow, then
one row per frame: X, Y, Z of each marker, after the frame and its time if these were exported. The file states neither
unit nor axes.
"""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

from wingfit.importers.numbers import Layout, count_of, positive_of, read_samples
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, Stated, raw_of
from wingfit.importers.source import Source
from wingfit.records.errors import fail

_KEY = re.compile(r"[A-Z][A-Z_]{3,}")
_OWN = {"NO_OF_FRAMES", "NO_OF_MARKERS", "MARKER_NAMES", "FILE_VERSION", "DATA_INCLUDED"}


def recognises(source: Source) -> bool:
    """Return whether at least two lines of the head start with words of the header of this format."""
    first = [re.split(r"[\t;,]", line, maxsplit=1)[0] for line in source.head[:20]]
    return len(_OWN.intersection(first)) >= 2


def read(source: Source, given: Given) -> Raw:
    """Return the tracks of a Qualisys file; DatasetError names line and remedy."""
    stated, places, start = _header(source)
    kind = (stated.get("DATA_INCLUDED") or ["3D"])[0]
    if kind != "3D":
        remedy = "export 3D data" if kind == "6D" else "track in 3D and export 3D data"
        raise fail(source.at(places["DATA_INCLUDED"]), kind, f"the file holds {kind} data, no tracks; {remedy}")
    if "MARKER_NAMES" not in stated:
        raise fail(source.file, None, "there is no line MARKER_NAMES; export with the TSV header")
    labels = stated["MARKER_NAMES"]
    if stated.get("NO_OF_MARKERS"):
        place = source.at(places["NO_OF_MARKERS"])
        count = count_of(stated["NO_OF_MARKERS"][0], place)
        if count != len(labels):
            message = f"NO_OF_MARKERS is {count}, but MARKER_NAMES has {len(labels)} names; export the file again"
            raise fail(place, count, message)
    layout, first = _layout(source, labels, start)
    raw = raw_of(layout, read_samples(source.rows("\t", first), layout, source, given.decimal), first=1)
    raw.time_unit, raw.times_where = Stated("s", "Qualisys format"), "column 'Time'"
    raw.unit_hint = "Qualisys Track Manager writes millimetres unless another unit was chosen"
    _state(raw, source, given, stated, places)
    return raw


def _header(source: Source) -> tuple[dict[str, list[str]], dict[str, int], int]:
    """Return the values and the line of each word of the header, and the first line after it."""
    stated: dict[str, list[str]] = {}
    places: dict[str, int] = {}
    for line in range(1, len(source.head) + 1):
        cells = source.cells(line, "\t")
        if not cells or not _KEY.fullmatch(cells[0]):
            return stated, places, line
        while cells and not cells[-1]:
            cells.pop()
        stated[cells[0]] = cells[1:]
        places[cells[0]] = line
    return stated, places, len(source.head) + 1


def _layout(source: Source, labels: list[str], start: int) -> tuple[Layout, int]:
    """Return the layout, and the first line of numbers; ``start`` is the first line after the header."""
    cells = source.cells(start, "\t")
    while cells and not cells[-1]:
        cells.pop()
    named = bool(cells) and cells[0][:1].isalpha() and cells[0].lower() not in ("nan", "null")
    if named:
        before = [cell.lower() for cell in cells[:2] if cell.lower() in ("frame", "time")]
    else:
        before = ["frame", "time"][: _columns_before(source, start, 3 * len(labels))]
    skip = len(before)
    columns = [(skip + 3 * m, skip + 3 * m + 1, skip + 3 * m + 2) for m in range(len(labels))]
    names = [*(word.capitalize() for word in before), *(f"{label} {axis}" for label in labels for axis in "XYZ")]
    frame = before.index("frame") if "frame" in before else None
    time = before.index("time") if "time" in before else None
    return Layout(labels, columns, names, time=time, frame=frame), start + 1 if named else start


def _columns_before(source: Source, start: int, coordinates: int) -> int:
    """Return how many columns (frame, time) precede the ``coordinates`` in a file without names of columns.

    A row may end with a tab, so that its count of cells does not decide: numbers of frames go up by one, times go up.
    """
    rows = [cells for n in range(start, len(source.head) + 1) if (cells := source.cells(n, "\t"))]
    if not rows or not _steps(rows, 0, whole=True):
        return 0
    extra = len(rows[0]) - coordinates
    return 2 if extra >= 2 and (extra == 2 or not rows[0][-1]) and _steps(rows, 1, whole=False) else int(extra >= 1)


def _steps(rows: list[list[str]], column: int, *, whole: bool) -> bool:
    """Return whether the numbers in ``column`` go up in all ``rows``, by one if they must be ``whole``."""
    try:
        found = [float(cells[column]) for cells in rows]
    except (ValueError, IndexError):
        return False
    return all(b - a == 1 if whole else b > a for a, b in pairwise(found))


def _state(raw: Raw, source: Source, given: Given, stated: dict[str, list[str]], places: dict[str, int]) -> None:
    def first(key: str) -> Any:
        return (stated.get(key) or [""])[0]

    if first("FREQUENCY") == "EXT":
        raw.rate_hint = f"line {places['FREQUENCY']} says that an external clock drove the cameras"
    elif first("FREQUENCY"):
        rate = positive_of(first("FREQUENCY"), source.at(places["FREQUENCY"]), "Hz", given.decimal)
        raw.rates = [Stated(rate, f"line {places['FREQUENCY']}, FREQUENCY")]
    if first("NO_OF_FRAMES"):
        count = count_of(first("NO_OF_FRAMES"), source.at(places["NO_OF_FRAMES"]))
        raw.frame_count = Stated(count, f"line {places['NO_OF_FRAMES']}, NO_OF_FRAMES")
    filled = sum("gap" in kind.lower() for kind in stated.get("TRAJECTORY_TYPES", []))
    if filled:
        raw.remarks.append(
            f"{filled} trajectories are gap-filled by the capture program: not all their points are measured"
        )
    if first("NO_OF_ANALOG") not in ("", "0"):
        raw.remarks.append(f"not imported: {first('NO_OF_ANALOG')[:12]} analogue channels")
    if "EVENT" in stated:
        raw.remarks.append("not imported: events")


READER = Reader("qualisys", "Qualisys TSV", recognises, read)
