"""Sparse text of DLTdv (version 8): ``*xyzpts.tsv``.

A title, then a line with the counts of rows, columns and values, then one line "row column value" for each coordinate
that was digitised; rows (frames) and columns (three for each point) count from 1. A sparse file of pixels
(``*xypts.tsv``) looks the same, so the user must state that this one holds 3-D points, by giving the format.
"""

from __future__ import annotations

import numpy as np

from wingfit.importers.limits import MAX_TRACK_VALUES
from wingfit.importers.numbers import EMPTY, count_of, number_of
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader
from wingfit.importers.readers.dltdv import RATE_HINT, UNIT_HINT
from wingfit.importers.source import Source
from wingfit.records.array_types import Array, Index
from wingfit.records.errors import Faults, check_most, fail
from wingfit.records.limits import MAX_MARKERS, MAX_ROWS


def recognises(source: Source) -> bool:
    """Return whether the second line has three counts and the third is a row, a column and a number."""
    sizes, first = source.cells(2, "\t"), source.cells(3, "\t")
    if len(sizes) != 3 or len(first) != 3 or not source.cells(1, "\t"):
        return False
    return all(cell.isascii() and cell.isdigit() for cell in (*sizes, *first[:2]))


def read(source: Source, given: Given) -> Raw:
    """Return the points of a sparse file; DatasetError names line and remedy."""
    sizes = source.cells(2, "\t")
    if len(sizes) != 3:
        raise fail(source.at(2), len(sizes), f"has {len(sizes)} cells; it must be counts of rows, columns and values")
    rows, width, count = (count_of(text, source.at(2, n)) for n, text in enumerate(sizes, 1))
    if rows < 1 or width < 3 or width % 3:
        message = f"has {rows} rows and {width} columns; 3-D points have three columns each, so this is no *xyzpts file"
        raise fail(source.at(2), width, message)
    check_most(source.at(2), "has", rows, MAX_ROWS, "frames", "cut the recording in parts")
    check_most(source.at(2), "has", width // 3, MAX_MARKERS, "points", "export fewer points")
    check_most(source.at(2), "has", rows * width, MAX_TRACK_VALUES, "numbers", "cut the recording in parts")
    matrix, lines = _matrix(source, rows, width, count, given)
    labels = [f"pt{point}" for point in range(1, width // 3 + 1)]
    positions = matrix.reshape(rows, -1, 3)
    return Raw(labels, positions, lines, "frame", unit_hint=UNIT_HINT, rate_hint=RATE_HINT)


def _matrix(source: Source, rows: int, width: int, count: int, given: Given) -> tuple[Array, Index]:
    matrix, faults, found = np.full((rows, width), EMPTY), Faults(), 0
    filled = np.zeros((rows, width), dtype=np.bool_)
    for line, cells in source.rows("\t", 3):
        if not any(cells):
            continue
        try:
            row, column, value = _entry(cells, rows, width, given)
            if filled[row, column]:
                raise ValueError(f"row {row + 1}, column {column + 1} appears twice; keep one")
            matrix[row, column], filled[row, column], found = value, True, found + 1
        except ValueError as error:
            faults.add(source.at(line), None, str(error))
        if faults.full or found > count:
            break
    faults.raise_any()
    if found != count:
        cause = "the file is cut off" if found < count else "the file was edited"
        which = f"{found} values follow" if found < count else f"more than {count} values follow"
        raise fail(source.file, found, f"{which}, but line 2 states {count}; {cause}: export it again")
    return matrix, np.arange(1, rows + 1)


def _entry(cells: list[str], rows: int, width: int, given: Given) -> tuple[int, int, float]:
    """Return (row, column) from 0, and the value; ValueError says what is wrong with the line."""
    if len(cells) != 3:
        raise ValueError(f"has {len(cells)} cells; it must have three: row, column, value")
    places = []
    for name, text, most in zip(("row", "column"), cells[:2], (rows, width), strict=True):
        digits = text.strip()
        if not (digits.isascii() and digits.isdigit() and len(digits) < 10 and 1 <= int(digits) <= most):
            raise ValueError(f"{name} {digits[:40]!r} is not in [1, {most}], as line 2 states; export the file again")
        places.append(int(digits) - 1)
    return places[0], places[1], number_of(cells[2], given.decimal)


WHY = (
    "the content does not say whether these are 3-D points (*xyzpts) or pixels (*xypts), which look the same; "
    "if they are 3-D points"
)
READER = Reader("dltdv-sparse", "DLTdv sparse TSV", recognises, read, WHY)
