"""CSV tables of numbers: a header, then a row per instant; an empty cell is a missing sample."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array
from wingfit.records.errors import Faults, check_most, decode, fail, nearest, shown
from wingfit.records.limits import MAX_ROWS

_NAMED = 6


@dataclass(frozen=True, eq=False)
class Table:
    """Columns [N] of numbers by name; ``file`` names the table in messages; ``labels`` [N]: names in column one."""

    file: str
    columns: dict[str, Array]
    labels: tuple[str, ...] = ()

    def column(self, name: str) -> Array:
        """The column ``name`` [N]; DatasetError, with the nearest name that exists, if there is none."""
        if name not in self.columns:
            message = f"there is no column {name!r}; {nearest(name, self.columns)}"
            raise fail(f"{self.file}, line 1", name, message)
        return self.columns[name]

    def track(self, marker: str) -> Array:
        """Positions [N, 3] in m of ``marker``, from columns ``<marker>_x_m``, ``_y_m``, ``_z_m``."""
        return np.stack([self.column(f"{marker}_{axis}_m") for axis in "xyz"], axis=-1)

    def times(self, name: str = "time_s") -> Array:
        """The column ``name`` [N] of times; DatasetError unless it is complete and strictly increases."""
        times = self.column(name)
        wrong = np.flatnonzero(~(np.diff(times) > 0))
        if len(wrong) or not np.isfinite(times[:1]).all():
            row = int(wrong[0]) + 1 if len(wrong) else 0
            message = f"row {row + 1} holds {times[row]:g}; times must be complete and increase: sort the rows"
            raise fail(f"{self.file}, column {name!r}", float(times[row]), message)
        return times


def header_of(raw: bytes, file: str) -> list[str]:
    """Names of the columns of the CSV text ``raw``, whose numbers are not read; empty for an empty file."""
    rows = csv.reader(io.StringIO(decode(raw, file), newline=""))
    return [name.strip() for name in next((row for row in rows if row), [])]


def require(header: Sequence[str], names: Sequence[str], file: str) -> None:
    """Raise DatasetError, which lists up to 6 of the ``names`` that are missing in ``header``, if any is."""
    missing = [name for name in names if name not in header]
    if missing:
        which = ", no ".join(map(repr, missing[:_NAMED])) + (", ..." if len(missing) > _NAMED else "")
        raise fail(f"{file}, line 1", missing[0], f"there is no column {which}; {nearest(missing[0], header)}")


def read_table(raw: bytes, file: str, label: str | None = None) -> Table:
    """Read the CSV text ``raw``. With ``label``, the first column must have that name and holds names, not numbers.

    DatasetError if the text is not such a table, or if cells are not numbers; it lists several such cells.
    """
    rows = [row for row in csv.reader(io.StringIO(decode(raw, file), newline="")) if row]
    if len(rows) < 2:
        raise fail(file, len(rows), f"holds {len(rows)} lines; it needs a header and rows of numbers")
    check_most(file, "has", len(rows), MAX_ROWS, "rows", "cut the recording in parts")
    header = [name.strip() for name in rows[0]]
    if len(header) == 1:
        raise fail(f"{file}, line 1", header[0], "has one column; separate columns by commas, with decimal points")
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise fail(f"{file}, line 1", twice, f"column {twice!r} appears twice; keep one")
    if label and header[0] != label:
        raise fail(f"{file}, line 1", header[0], f"the first column is {header[0]!r}; it must be {label!r}")
    skip = 1 if label else 0
    faults = Faults()
    numbers = [_numbers(row, header, f"{file}, row {i}", skip, faults) for i, row in enumerate(rows[1:], 1)]
    faults.raise_any()
    values = np.array(numbers, dtype=np.float64)
    columns = {name: values[:, i] for i, name in enumerate(header[skip:])}
    return Table(file, columns, tuple(row[0].strip() for row in rows[1:]) if label else ())


def _numbers(row: Sequence[str], header: Sequence[str], where: str, skip: int, faults: Faults) -> list[float]:
    if len(row) != len(header):
        cause = "decimal commas, or a comma too many or too few"
        faults.add(where, None, f"has {len(row)} cells where the header has {len(header)}; {cause}")
        return [math.nan] * (len(header) - skip)
    cells = zip(header[skip:], row[skip:], strict=True)
    return [_number(cell.strip(), f"{where}, column {name!r}", faults) for name, cell in cells]


def _number(cell: str, where: str, faults: Faults) -> float:
    try:
        value = float(cell) if cell else math.nan
    except ValueError:
        value = math.inf
    if math.isinf(value):
        message = f"is {shown(cell)!r}; it must be a finite number, or an empty cell where nothing was seen"
        faults.add(where, cell, message)
    return value
