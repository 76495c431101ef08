"""Reads an outline from a table: corners (x, y) in their order, or stations (span, leading edge, trailing edge).

Points may have no header. Stations have one: span (or y), leading_edge, and trailing_edge or chord, each with its unit
(span_mm) or not.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import isfinite, isnan
from typing import Literal

import numpy as np

from wingfit.importers.numbers import number_of
from wingfit.importers.options import UNITS, Decimal, unit_of
from wingfit.importers.planform.shapes import Drawn, Scale, Shape
from wingfit.importers.source import Source, open_source, separator_of
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import Faults, check_most, fail

MAX_POINTS = 20_000
_HEADER = re.compile(
    r"(?P<name>.+?)(?:(?:[\s_./]+|(?=[\[(]))[\[(]?(?P<unit>mm|cm|um|µm|m|in|ft|px)[\])]?)?", re.IGNORECASE
)
_NAMES = {
    "x": ("x",),
    "y": ("y",),
    "span": ("span", "y", "r", "spanwise", "span position"),
    "leading": ("leading_edge", "leading edge", "le", "x_le", "leading"),
    "trailing": ("trailing_edge", "trailing edge", "te", "x_te", "trailing"),
    "chord": ("chord", "c"),
}


def read_table(raw: bytes, file: str, decimal: Decimal) -> Drawn:
    """Return the outline in a table of points or of stations; DatasetError names line, column and remedy."""
    source = open_source(raw, file)
    line = next((n for n in range(1, len(source.head) + 1) if any(source.cells(n))), None)
    if source.encoding is None or line is None:
        raise fail(file, None, "is no drawing (SVG, DXF) and no table; export the outline as SVG, or write x,y as CSV")
    separator = separator_of(source.head[line - 1])
    cells = source.cells(line, separator)
    if all(_is_number(cell, decimal) for cell in cells if cell):
        columns, unit, start = {"x": 0, "y": 1}, None, line
        if len(cells) != 2:
            message = f"has {len(cells)} numbers and there is no header; points have two: x and y"
            raise fail(source.at(line), len(cells), message)
    else:
        columns, unit = _columns(source, cells, line)
        start = line + 1
    numbers = _numbers(source, separator, start, columns, decimal)
    scale = Scale(UNITS[unit][0] / UNITS[unit][1], unit, f"line {line}, names of the columns") if unit else None
    return _stations(numbers, columns, scale, file) if "span" in columns else _points(numbers, scale, file)


def _is_number(cell: str, decimal: Decimal) -> bool:
    try:
        return isfinite(number_of(cell, decimal))
    except ValueError:
        return False


def _columns(source: Source, cells: Sequence[str], line: int) -> tuple[dict[str, int], str | None]:
    """Return the index of each column by its meaning, and the unit in the names; DatasetError if it is unclear."""
    matches = [_HEADER.fullmatch(cell[:100]) for cell in cells]
    names = [match["name"].strip().lower() if match else "" for match in matches]
    found: dict[str, int] = {
        meaning: names.index(name) for meaning, words in _NAMES.items() for name in reversed(words) if name in names
    }
    if {"span", "leading"} <= set(found) and ("trailing" in found) != ("chord" in found):
        wanted: list[str] = [key for key in ("span", "leading", "trailing", "chord") if key in found]
    elif {"x", "y"} <= set(found) and not {"leading", "trailing", "chord"} & set(found):
        wanted = ["x", "y"]
    else:
        message = (
            f"has the columns {', '.join(filter(None, cells))[:120]}; points need x,y, and stations need "
            "span,leading_edge and either trailing_edge or chord (a chord alone does not say how the wing is swept)"
        )
        raise fail(source.at(line), None, message)
    columns = {key: found[key] for key in wanted}
    units = {(match["unit"] or "").lower() for k in columns.values() if (match := matches[k])}
    if len(units) > 1:
        listed = ", ".join(sorted(unit or "none" for unit in units))
        raise fail(source.at(line), listed, f"the columns state the units {listed}; write all in one unit")
    unit = unit_of(units.pop())
    return columns, unit if unit in UNITS else None


def _numbers(
    source: Source, separator: str, start: int, columns: dict[str, int], decimal: Decimal
) -> Float[Array, "N K"]:
    faults, rows = Faults(), []
    for line, cells in source.rows(separator, start):
        if not any(cell.strip() for cell in cells):
            continue
        row = []
        for name, index in columns.items():
            text = cells[index] if index < len(cells) else ""
            try:
                value = number_of(text, decimal)
                if isnan(value):
                    raise ValueError("is empty; an outline needs a number in each cell: remove the row, or fill it in")
                row.append(value)
            except ValueError as error:
                words = str(error).replace(", or an empty cell where nothing was measured", "")
                faults.add(source.at(line, name), text, words)
        rows.append(row)
        check_most(source.file, "has at least", len(rows), MAX_POINTS, "points", "keep fewer")
        if faults.full:
            break
    faults.raise_any()
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(columns))


def _points(numbers: Float[Array, "N 2"], scale: Scale | None, file: str) -> Drawn:
    if len(numbers) < 3:
        raise fail(file, len(numbers), f"has {len(numbers)} points; an outline needs at least 3")
    return Drawn("points", [Shape("points", numbers, closed=False)], unit=scale)


def _stations(numbers: Float[Array, "N 3"], columns: dict[str, int], scale: Scale | None, file: str) -> Drawn:
    """Return the outline of stations: x along the chord, y along the span."""
    if len(numbers) < 2:
        raise fail(file, len(numbers), f"has {len(numbers)} stations; at least 2 are needed")
    span, leading, last = numbers.T
    steps = np.diff(span)
    if not (np.all(steps > 0) or np.all(steps < 0)):
        at = int(np.flatnonzero(np.sign(steps) != np.sign(steps[0]) if steps[0] else steps == 0)[0]) + 1
        message = f"span {span[at]:g} follows {span[at - 1]:g}; sort the stations along the span, each once"
        raise fail(file, float(span[at]), message)
    if "chord" in columns:
        wrong, trailing = last <= 0, leading + last
        message = "a chord must be above 0; write stations from leading to trailing edge, with x increasing aft"
    else:
        sign = np.sign((last - leading).sum())
        wrong, trailing = (last - leading) * sign < 0, last
        message = "leading and trailing edge change places between stations; check the columns"
    if wrong.any() or not (last - (0 if "chord" in columns else leading)).any():
        at = int(np.flatnonzero(wrong)[0]) if wrong.any() else 0
        raise fail(file, float(last[at]), f"station {at + 1} at span {span[at]:g}: {message}")
    points = np.concatenate([np.column_stack([leading, span]), np.column_stack([trailing, span])[::-1]])
    aft: Literal["low-x", "high-x"] = "high-x" if (trailing - leading).sum() > 0 else "low-x"
    return Drawn("stations", [Shape("stations", points, closed=True)], unit=scale, aft=aft)
