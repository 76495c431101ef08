"""Reads and writes the samples of one recording as CSV: a column ``time_s``, and a column for each channel.

Numbers are written by ``repr`` and read by ``float``, which is exact. If a file has only characters that occur in
numbers, ``float`` alone reads it; else a slower function does, which rejects texts that only Python takes for numbers.
"""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float, Index, Int
from wingfit.records.dataset import ForceAxis
from wingfit.records.description.yaml_text import NUMBER
from wingfit.records.errors import DatasetError, Faults, check_most, decode, fail, shown
from wingfit.records.limits import MAX_COLUMNS, MAX_ROWS, MAX_VALUES, MIN_FRAMES

_WRITTEN = 1000  # rows that are converted at once
_SUSPICIOUS = re.compile(r"[^0-9eE+\-., \r\n]")
_TIMES = {"time", "t", "t_s", "times", "time_ms", "time_us", "seconds", "frame", "frames", "timestamp", "time_min"}
_MISSING_WORDS = {"nan", "na", "n/a", "null", "none", "-", "--", "missing", "#n/a"}


@dataclass(frozen=True)
class Samples:
    """The numbers of a recording of ``markers`` or of ``forces`` (see :class:`wingfit.records.Recording`), or a series.

    ``quantities`` names the columns of ``values`` of a series: its channels, then its inputs.
    ``lines`` [T] are for messages: the line of a CSV file that holds each instant, or its index in other files.
    """

    times: Float[Array, " T"]
    values: Float[Array, "T C"]
    lines: Int[Index, " T"]
    markers: tuple[str, ...] = ()
    forces: tuple[ForceAxis, ...] = ()
    quantities: tuple[str, ...] = ()


@dataclass(frozen=True)
class Layout:
    """Order of a CSV file: index of the column ``time``, and indices ``columns`` [C] of the columns of the channels."""

    time: int
    columns: list[int]
    markers: tuple[str, ...] = ()
    forces: tuple[ForceAxis, ...] = ()
    quantities: tuple[str, ...] = ()


def write_table(columns: Sequence[str], times: Float[Array, " T"], values: Float[Array, "T C"]) -> str:
    """Return CSV with the column ``time_s`` and ``values`` [T, C] under the names ``columns``; NaN is an empty cell."""
    # As lists, numbers take four times the memory: a thousand rows at a time.
    parts = [slice(first, first + _WRITTEN) for first in range(0, len(times), _WRITTEN)]
    rows = (row for part in parts for row in zip(times[part].tolist(), values[part].tolist(), strict=True))
    lines = (",".join([repr(time), *(repr(v) if v == v else "" for v in row)]) for time, row in rows)
    return "\n".join([",".join(["time_s", *columns]), *lines, ""])


def read_table(raw: bytes, file: str, read_layout: Callable[[list[str], str], Layout], room: int, gap: str) -> Samples:
    """Read samples from the contents ``raw`` of a CSV ``file`` with at most ``room`` numbers.

    ``read_layout(header, where)`` checks the header and returns the layout. ``gap`` says in messages when a cell may be
    empty. DatasetError names line and column of every error.
    """
    text = decode(raw, file)
    if not text.strip():
        raise fail(file, None, f"the file is empty; it needs a header and at least {MIN_FRAMES} rows")
    # Not io.StringIO, which takes four bytes per character.
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(raw), "utf-8-sig", newline=""), strict=True)
    try:
        header = [name.strip() for name in next(reader)]
        check_most(f"{file}, line 1", "has", len(header), MAX_COLUMNS, "columns", "remove those that are not needed")
        if not header:
            raise fail(f"{file}, line 1", None, "the line is empty; it must name the columns, 'time_s' first")
        layout = read_layout(header, f"{file}, line 1")
        clean = not _SUSPICIOUS.search(text, text.find("\n"))
        matrix, lines = _rows(reader, header, file, room, None if clean else gap)
    except csv.Error as error:
        message = f"not valid CSV: {error}; separate with commas, without stray quotes or NUL bytes"
        raise fail(f"{file}, line {reader.line_num}", None, message) from None
    values = np.ascontiguousarray(matrix[:, layout.columns])
    return Samples(matrix[:, layout.time].copy(), values, lines, layout.markers, layout.forces, layout.quantities)


def read_columns(
    header: Sequence[str], where: str, problem: Callable[[str], str | None], known: Collection[str] = ()
) -> dict[str, int]:
    """Check the names of the columns and return the index of each by name; DatasetError lists wrong names.

    ``problem(name)`` returns what is wrong with a name other than ``time_s``, or None. ``known`` names may be such as
    otherwise mean times in another unit.
    """
    for separator, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and separator in header[0]:
            message = f"the columns are separated by {word}; separate by commas, with decimal points"
            raise fail(where, header[0], message)
    columns, faults = dict[str, int](), Faults()
    for index, name in enumerate(header):
        wrong = _column_problem(name, columns, known) or (problem(name) if name != "time_s" else None)
        if wrong:
            faults.add(f"{where}, column {index + 1}", name, wrong)
        if faults.full:
            break
        columns.setdefault(name, index)
    faults.raise_any()
    if "time_s" not in columns:
        raise fail(where, header[0], "column 'time_s' is missing; add it first, with times in seconds")
    return columns


def _column_problem(name: str, earlier: dict[str, int], known: Collection[str]) -> str | None:
    if name in earlier:
        return f"column {name!r} is also column {earlier[name] + 1}; keep one"
    if not name:
        return "this column has no name; name it or remove the comma at the end of the lines"
    if name != "time_s" and name not in known and (name.lower() in _TIMES or name.lower() == "time_s"):
        return f"unknown column {name!r}; write 'time_s', with times in seconds"
    return None


def _rows(
    reader: Iterable[list[str]], header: Sequence[str], file: str, room: int, gap: str | None
) -> tuple[Array, Index]:
    """Read all rows as numbers [T, columns]; return them and the line of each row [T].

    ``gap`` is None if the text has only characters that occur in numbers; else it says when a cell may be empty.
    """
    convert = _fast if gap is None else _strict
    numbers, lines, width, faults = array("d"), array("q"), len(header), Faults()
    line = getattr(reader, "line_num", 1)
    for row in reader:
        line = getattr(reader, "line_num", line + 1)
        if not row:
            continue
        if len(row) != width:
            faults.add(f"{file}, line {line}", ",".join(row), _ragged(row, width))
        else:
            try:
                numbers.extend(convert(row))
            except ValueError:
                numbers.extend(_checked_cells(row, header, f"{file}, line {line}", gap or "there is no number", faults))
            lines.append(line)
        if faults.full:
            break
        if len(lines) > MAX_ROWS:
            message = f"has more than {MAX_ROWS} rows, the most that are read; cut the recording in parts"
            raise fail(file, len(lines), message)
        if len(numbers) > room:
            raise too_much(file)
    faults.raise_any()
    matrix = np.frombuffer(numbers, dtype=np.float64).reshape(-1, width)
    for index, column in np.argwhere(np.isinf(matrix))[:10]:
        place = f"{file}, line {lines[index]}, column {header[column]!r}"
        faults.add(place, None, "is too large for a number; check its unit")
    faults.raise_any()
    return matrix, np.array(lines, dtype=np.int64)


def _fast(row: list[str]) -> list[float]:
    return [float(cell) if cell else math.nan for cell in row]


def _strict(row: list[str]) -> list[float]:
    return [_cell(cell) for cell in row]


def _cell(cell: str) -> float:
    text = cell.strip()
    if not text:
        return math.nan
    if not NUMBER.fullmatch(text):
        raise ValueError(text)
    return float(text)


def _checked_cells(row: list[str], header: Sequence[str], where: str, gap: str, faults: Faults) -> list[float]:
    """Convert a row cell by cell; add a fault, and return NaN, for every cell that is not a number."""
    numbers = []
    for name, cell in zip(header, row, strict=True):
        try:
            numbers.append(_cell(cell))
        except ValueError:
            faults.add(f"{where}, column {name!r}", cell, _not_a_number(cell.strip(), gap))
            numbers.append(math.nan)
    return numbers


def _not_a_number(text: str, gap: str) -> str:
    if text.lower().lstrip("+-") in {"inf", "infinity"}:
        return f"is {text!r}; it must be a finite number, or an empty cell where {gap}"
    if text.lower() in _MISSING_WORDS:
        return f"is {text!r}; leave the cell empty where {gap}"
    return f"is {shown(text)!r}; it must be a number, or an empty cell where {gap}"


def _ragged(row: list[str], width: int) -> str:
    cause = "the line is cut off, or commas are missing" if len(row) < width else "decimal commas, or a comma too many"
    return f"has {len(row)} cells where the header has {width}; {cause}"


def too_much(where: str, most: int = MAX_VALUES) -> DatasetError:
    """Return the error for a dataset with more than ``most`` numbers."""
    message = f"the dataset holds more than {most} numbers, the most that are read; split it or thin it out"
    return fail(where, None, message)
