"""CSV of DLTdv (versions 5 to 8), dense: ``*xyzpts.csv``.

The header is pt1_X, pt1_Y, pt1_Z, pt2_X, ...; each row is a frame of the video, mostly NaN. There is no unit (it is
that of the calibration), no rate and no time. ``*xypts.csv`` (pt1_cam1_X, ...) are pixels and are refused.
"""

from __future__ import annotations

import re

from wingfit.importers.numbers import Layout, read_samples
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, raw_of
from wingfit.importers.source import Source, separator_of
from wingfit.records.errors import Faults, fail

_COLUMN = re.compile(r"(pt[0-9]+)_([XYZ])", re.IGNORECASE)
_PIXELS = re.compile(r"pt[0-9]+_cam[0-9]+_[XY]", re.IGNORECASE)
UNIT_HINT = "positions are in the unit of the calibration"
RATE_HINT = "each row is a frame of the video"


def recognises(source: Source) -> bool:
    """Return whether all columns have names of DLTdv."""
    cells = [cell for cell in source.cells(1) if cell]
    return bool(cells) and all(_COLUMN.fullmatch(cell) or _PIXELS.fullmatch(cell) for cell in cells)


def read(source: Source, given: Given) -> Raw:
    """Return the points of a DLTdv file; DatasetError names line, column and remedy."""
    separator = separator_of(source.head[0]) if source.head else ","
    cells = source.cells(1, separator)
    while cells and not cells[-1]:
        cells.pop()
    if any(_PIXELS.fullmatch(cell) for cell in cells):
        message = "the columns are pixels of single cameras; export the 3-D points, *xyzpts.csv (triangulate first)"
        raise fail(source.at(1), cells[0], message)
    places, faults = dict[str, dict[str, int]](), Faults()
    for index, cell in enumerate(cells):
        match = _COLUMN.fullmatch(cell)
        if not match:
            faults.add(source.at(1, index + 1), cell, f"is {cell!r}; DLTdv names columns pt1_X, pt1_Y, pt1_Z, ...")
        elif match[2].upper() in places.setdefault(match[1].lower(), {}):
            faults.add(source.at(1, index + 1), cell, f"column {cell!r} appears twice; remove one")
        else:
            places[match[1].lower()][match[2].upper()] = index
    for label, found in places.items():
        if len(found) < 3 and not faults.full:
            faults.add(source.at(1), label, f"{label} has {', '.join(found)} only; a point needs X, Y and Z")
    faults.raise_any()
    if not places:
        raise fail(source.at(1), None, "there is no column pt1_X, pt1_Y, pt1_Z; this is no file of DLTdv")
    columns = [(found["X"], found["Y"], found["Z"]) for found in places.values()]
    layout = Layout([*places], columns, cells)
    samples = read_samples(source.rows(separator, 2), layout, source, given.decimal)
    return raw_of(layout, samples, unit_hint=UNIT_HINT, rate_hint=RATE_HINT)


READER = Reader("dltdv", "DLTdv CSV", recognises, read)
