"""Reads rows of a text file as numbers, and says line, column and remedy for every cell that is none.

A gap is NaN. Whether the cell was empty or held a word for "not a number" is stored in the sign bit of the NaN, which
costs no memory: it is set for a word.
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.importers.limits import MAX_TRACK_VALUES
from wingfit.importers.options import Decimal, question
from wingfit.importers.source import SEPARATORS, Row, Source
from wingfit.records.array_types import Array, Float, Index, Int
from wingfit.records.errors import Faults, check_most, counted, fail, shown
from wingfit.records.limits import MAX_MARKERS, MAX_ROWS

EMPTY = math.nan
WORD = math.copysign(math.nan, -1.0)
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,6})?")
_WITH_COMMA = re.compile(r"[-+]?(?:[0-9]+,?[0-9]*|,[0-9]+)(?:[eE][-+]?[0-9]{1,6})?")
_THOUSANDS = re.compile(r"[-+]?[0-9]{1,3}(?:[,.' \u00a0\u202f][0-9]{3})+(?:[.,][0-9]+)?")
_WORDS = {"nan", "na", "n/a", "null", "none", "nil", "-", "--", "missing", "#n/a", "#na", "?", "."}
# What C libraries print for "not a number": nan(ind), -nan(snan), 1.#QNAN0, -1.#IND00.
_WORD = re.compile(r"[-+]?(?:nan(?:\([\w ]*\))?|1[.,]#(?:qnan|snan|ind|nan)[0-9]*)", re.IGNORECASE)
_INFINITE = re.compile(r"[-+]?(?:inf(?:inity)?|∞|1[.,]#inf[0-9]*)", re.IGNORECASE)
_OTHER = re.compile(r"[^0-9eE+\-., ]")  # characters with which float accepts what is no number of a table: 1_0, inf
_MAX_LENGTH = 400


class DecimalCommaError(ValueError):
    """Raised for a cell that is a number if its comma separates decimals."""


@dataclass(frozen=True)
class Layout:
    """Where the tracks are in the rows of a text file.

    Attributes:
        labels: names [M] of the markers.
        columns: [M][3], index of the column of each coordinate.
        names: of all columns, for messages; each row must have as many cells, but for empty ones at its end.
        time: index of the column of times, or None.
        frame: index of the column of frame numbers, or None.
    """

    labels: list[str]
    columns: list[tuple[int, int, int]]
    names: Sequence[str]
    time: int | None = None
    frame: int | None = None


@dataclass(frozen=True, eq=False)
class Samples:
    """The numbers of a text file, as in :class:`wingfit.importers.raw.Raw`."""

    positions: Float[Array, "T M 3"]
    lines: Int[Index, " T"]
    times: Float[Array, " T"] | None
    frames: Int[Index, " T"] | None


def read_samples(
    rows: Iterable[Row],
    layout: Layout,
    source: Source,
    decimal: Decimal,
    keep: Callable[[list[str]], bool] | None = None,
) -> Samples:
    """Read ``rows`` of numbers in the ``layout``; ``keep(cells)`` says which rows are wanted, None: all.

    DatasetError names line and column of each wrong cell (several at once) and the remedy.
    """
    check_most(source.file, "has", len(layout.labels), MAX_MARKERS, "markers", "export fewer markers")
    wanted = [column for place in layout.columns for column in place]
    wanted += [column for column in (layout.time, layout.frame) if column is not None]
    matrix, lines = read_columns(rows, wanted, layout.names, source, decimal, keep)
    count = 3 * len(layout.labels)
    times = matrix[:, count].copy() if layout.time is not None else None
    frames = None
    if layout.frame is not None:
        frames = whole_numbers(matrix[:, -1], lines, layout.names[layout.frame], source)
    return Samples(matrix[:, :count].reshape(len(matrix), -1, 3).copy(), lines, times, frames)


def read_columns(
    rows: Iterable[Row],
    wanted: list[int],
    names: Sequence[str],
    source: Source,
    decimal: Decimal,
    keep: Callable[[list[str]], bool] | None = None,
) -> tuple[Array, Index]:
    """Return the numbers [T, K] in the K ``wanted`` columns (indices) of ``rows``, and the line [T] of each.

    ``names`` are those of all columns; the other arguments and DatasetError are as in read_samples.
    """
    numbers, lines, faults, blank, width = array("d"), array("q"), Faults(), 0, len(names)
    left_out = 0
    for line, cells in rows:
        if not any(cells):
            blank = blank or line
            continue
        if blank and lines:
            faults.add(source.at(blank), None, "is empty, between lines of numbers; remove it or fill it in")
        blank = 0
        if len(cells) != width and (len(cells) < width or any(cell.strip() for cell in cells[width:])):
            faults.add(source.at(line), len(cells), _ragged(cells, width))
        elif keep is None or keep(cells):
            numbers.extend(_row(cells, wanted, names, source, line, decimal, faults))
            lines.append(line)
        else:
            left_out += 1
        if faults.full:
            break
        if len(lines) > MAX_ROWS or len(numbers) > MAX_TRACK_VALUES:
            check_most(source.file, "has at least", len(lines), MAX_ROWS, "frames", "cut the recording in parts")
            check_most(source.file, "has at least", len(numbers), MAX_TRACK_VALUES, "numbers", "export fewer markers")
    faults.raise_any()
    if not lines:
        if left_out:
            message = (
                f"no row has these values ({counted(left_out, 'row')} read); compare them with the cells of the file"
            )
            raise fail("--rows", 0, message)
        raise fail(source.file, 0, "has no frames: no line of numbers was read; export it again")
    return np.frombuffer(numbers, dtype=np.float64).reshape(len(lines), -1), np.array(lines, dtype=np.int64)


def _row(
    cells: list[str],
    wanted: list[int],
    names: Sequence[str],
    source: Source,
    line: int,
    decimal: Decimal,
    faults: Faults,
) -> list[float]:
    fast = _fast(cells, wanted) if decimal == "point" else None
    if fast is not None:
        return fast
    numbers = []
    for column in wanted:
        try:
            numbers.append(number_of(cells[column], decimal))
        except ValueError as error:
            name = names[column] or column + 1
            where, value = source.at(line, name), cells[column]
            if isinstance(error, DecimalCommaError):
                faults.put(question("decimal", where, value, str(error), ["comma"]))
            else:
                faults.add(where, value, str(error))
            numbers.append(math.nan)
    return numbers


def _fast(cells: list[str], wanted: list[int]) -> list[float] | None:
    """Return the numbers of a row in which ``float`` alone can decide; None for any other row."""
    texts = [cells[column] for column in wanted]
    if _OTHER.search(",".join(texts)):
        return None
    try:
        numbers = [float(text) if text else EMPTY for text in texts]
    except ValueError:
        return None
    return None if math.inf in numbers or -math.inf in numbers else numbers


def number_of(cell: str, decimal: Decimal = "point") -> float:
    """Return the number in ``cell``, EMPTY or WORD; ValueError says what is wrong, and the remedy."""
    text = cell.strip()
    if not text:
        return EMPTY
    pattern = _NUMBER if decimal == "point" else _WITH_COMMA
    if pattern.fullmatch(text) and len(text) <= _MAX_LENGTH:
        value = float(text if decimal == "point" else text.replace(",", "."))
        if value in (math.inf, -math.inf):
            raise ValueError(f"is {shown(text)!r}, which is too large for a number; check the file")
        return value
    if text.lower() in _WORDS or _WORD.fullmatch(text):
        return WORD
    if decimal == "point" and _WITH_COMMA.fullmatch(text):
        thousands = "; if it separates thousands, export the numbers without it" if _THOUSANDS.fullmatch(text) else ""
        message = f"is {shown(text)!r}; if this is a decimal comma, give --decimal comma{thousands}"
        raise DecimalCommaError(message)
    raise ValueError(_not_a_number(text, decimal))


def _not_a_number(text: str, decimal: Decimal) -> str:
    """Return what is wrong with the cell ``text``, which is no number, with the remedy."""
    if _INFINITE.fullmatch(text):
        return f"is {text!r}; it must be a finite number, or an empty cell where nothing was measured"
    if decimal == "comma" and _NUMBER.fullmatch(text):
        return f"is {shown(text)!r}, with a decimal point; leave --decimal comma out, or export the file again"
    if _THOUSANDS.fullmatch(text):
        return f"is {text!r}, with a separator of thousands; export the numbers without one"
    return f"is {shown(text)!r}; it must be a number, or an empty cell where nothing was measured"


def _ragged(cells: list[str], width: int) -> str:
    cause = "the line is cut off" if len(cells) < width else "decimal commas, or a separator too many"
    return f"has {counted(len(cells), 'cell')} where the header has {width}; {cause}: export the file again"


def whole_numbers(values: Float[Array, " T"], lines: Int[Index, " T"], name: str, source: Source) -> Int[Index, " T"]:
    """Return numbers of frames as integers; DatasetError names the first that is missing or none."""
    wrong = ~(np.isfinite(values) & (np.abs(values) < 2**53))
    wrong |= np.where(wrong, 0.0, values) != np.round(np.where(wrong, 0.0, values))
    if wrong.any():
        at = int(np.flatnonzero(wrong)[0])
        message = f"is {values[at]:g}; a number of a frame must be a whole number"
        raise fail(source.at(int(lines[at]), name), float(values[at]), message)
    return values.astype(np.int64)


def count_of(text: str, where: str) -> int:
    """Return the count that a file states as ``text``; DatasetError if it is none."""
    if not re.fullmatch(r"[0-9]{1,9}(?:\.0*)?", text.strip()):
        raise fail(where, text, f"is {shown(text)!r}; it must be a count, such as 652: export the file again")
    return int(float(text))


def positive_of(text: str, where: str, unit: str, decimal: Decimal) -> float:
    """Return the positive number that a file states as ``text``; DatasetError if it is none."""
    try:
        value = number_of(text, decimal)
    except ValueError as error:
        raise fail(where, text, str(error)) from None
    if not value > 0:
        raise fail(where, text, f"is {shown(text)!r}; it must be a number of {unit} above 0: export the file again")
    return value


def separated_by(separator: str) -> str:
    """Return the name of a ``separator`` for messages: "tabs"."""
    return SEPARATORS.get(separator, repr(separator))
