"""One recording as CSV: ``time_s``, then ``<marker>_x_m``, ``<marker>_y_m``, ``<marker>_z_m``, or nothing.

Numbers are written by ``repr`` and read by ``float``, which is exact. A clean row costs one ``float`` a cell;
only a file with anything suspicious in it takes the slow road that names the cell.
"""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from records.dataset import Recording
from records.errors import DatasetError, Faults, decode, fail, nearest, shown
from records.limits import MAX_MARKERS, MAX_ROWS, MAX_VALUES, MIN_FRAMES
from records.yaml_text import NUMBER

Array = npt.NDArray[np.float64]
_SUSPICIOUS = re.compile(r"[^0-9eE+\-., \r\n]")
_COLUMN = re.compile(r"(?P<marker>.+)_(?P<axis>[xyz])_m")
_OTHER_UNIT = re.compile(r"(?P<marker>.+?)_?(?P<axis>[xyzXYZ])(?:_?(?:mm|cm|m|px|in|um))?")
_TIMES = {
    "time",
    "t",
    "t_s",
    "times",
    "time_ms",
    "time_us",
    "seconds",
    "frame",
    "frames",
    "timestamp",
    "time_min",
}
_MISSING_WORDS = {"nan", "na", "n/a", "null", "none", "-", "--", "missing", "#n/a"}


@dataclass(frozen=True)
class Tracks:
    """The numbers of a recording; ``lines`` [T] is the line of the file that each instant came from."""

    times: Array
    markers: tuple[str, ...]
    values: Array
    lines: npt.NDArray[np.int64]


def write_tracks(recording: Recording) -> str:
    """CSV text of a recording."""
    header = ["time_s", *(f"{channel}_m" for channel in recording.channels)]
    rows = zip(recording.times.tolist(), recording.values.tolist(), strict=True)
    lines = (",".join([repr(time), *(repr(v) if v == v else "" for v in row)]) for time, row in rows)
    return "\n".join([",".join(header), *lines, ""])


def read_tracks(raw: bytes, file: str, known: Sequence[str], room: int = MAX_VALUES) -> Tracks:
    """Read CSV; ``known`` are the wing's markers, ``room`` the numbers the dataset may still hold.

    DatasetError names line and column of everything that is not as it should be.
    """
    text = decode(raw, file)
    if not text.strip():
        raise fail(file, None, f"the file is empty; it needs a header and at least {MIN_FRAMES} rows")
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [name.strip() for name in next(reader)]
        layout = _Layout.read(header, file, known)
        matrix, lines = _rows(reader, header, file, room, clean=not _SUSPICIOUS.search(text, text.find("\n")))
    except csv.Error as error:
        message = f"not valid CSV: {error}; separate with commas, without stray quotes or NUL bytes"
        raise fail(f"{file}, line {reader.line_num}", None, message) from None
    values = np.ascontiguousarray(matrix[:, layout.columns])
    return Tracks(matrix[:, layout.time].copy(), layout.markers, values, lines)


@dataclass(frozen=True)
class _Layout:
    """Which columns hold what: ``columns`` [C] in the order marker by marker, x, y, z."""

    time: int
    markers: tuple[str, ...]
    columns: list[int]

    @classmethod
    def read(cls, header: Sequence[str], file: str, known: Sequence[str]) -> _Layout:
        where, faults = f"{file}, line 1", Faults()
        _check_separator(header, where)
        columns: dict[str, int] = {}
        for index, name in enumerate(header):
            problem = _column_problem(name, columns, known)
            if problem:
                faults.add(f"{where}, column {index + 1}", name, problem)
            columns.setdefault(name, index)
        faults.raise_any()
        if "time_s" not in columns:
            raise fail(where, header[0], "column 'time_s' is missing; add it first, with times in seconds")
        found = (_COLUMN.fullmatch(name) for name in header)
        markers = tuple(dict.fromkeys(match["marker"] for match in found if match))
        for name in (f"{marker}_{axis}_m" for marker in markers for axis in "xyz"):
            if name not in columns:
                message = f"column {name!r} is missing; a marker needs its x, y and z (cells may be empty)"
                faults.add(where, name, message)
        if not markers:
            faults.add(where, ",".join(header), "there is no marker; add columns such as " + _example(known))
        if len(markers) > MAX_MARKERS:
            faults.add(where, len(markers), f"{len(markers)} markers; at most {MAX_MARKERS} are read: remove some")
        faults.raise_any()
        return cls(columns["time_s"], markers, [columns[f"{m}_{axis}_m"] for m in markers for axis in "xyz"])


def _check_separator(header: Sequence[str], where: str) -> None:
    for separator, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and separator in header[0]:
            message = f"the columns are separated by {word}; separate by commas, with decimal points"
            raise fail(where, header[0], message)


def _column_problem(name: str, earlier: dict[str, int], known: Sequence[str]) -> str | None:
    if name in earlier:
        return f"column {name!r} also stands as column {earlier[name] + 1}; keep one"
    if name == "time_s":
        return None
    if not name:
        return "this column has no name; name it or remove the comma at the end of the lines"
    if name.lower() in _TIMES or name.lower() == "time_s":
        return f"unknown column {name!r}; write 'time_s', with times in seconds"
    match = _COLUMN.fullmatch(name)
    if match and match["marker"] in known:
        return None
    if match:
        return f"no marker is called {match['marker']!r} in dataset.yaml; {nearest(match['marker'], known)}"
    other = _OTHER_UNIT.fullmatch(name)
    if other and other["marker"] in known:
        wanted = f"{other['marker']}_{other['axis'].lower()}_m"
        return f"unknown column {name!r}; write {wanted!r}, with positions in metres"
    return f"unknown column {name!r}; columns are time_s and {_example(known)}: remove what is neither"


def _example(known: Sequence[str]) -> str:
    marker = known[0] if known else "marker"
    return ", ".join(f"{marker}_{axis}_m" for axis in "xyz")


def _rows(
    reader: Iterable[list[str]], header: Sequence[str], file: str, room: int, *, clean: bool
) -> tuple[Array, npt.NDArray[np.int64]]:
    """Read all rows as numbers [T, columns], and their lines. ``clean`` text holds no letters, no 'nan'."""
    convert: Callable[[list[str]], list[float]] = _fast if clean else _strict
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
                numbers.extend(_explained(row, header, f"{file}, line {line}", faults))
            lines.append(line)
        if faults.full:
            break
        _check_size(len(lines), len(numbers), file, room)
    faults.raise_any()
    matrix = np.frombuffer(numbers, dtype=np.float64).reshape(-1, width)
    for index, column in np.argwhere(np.isinf(matrix))[:10]:
        faults.add(
            f"{file}, line {lines[index]}, column {header[column]!r}",
            None,
            "is too large for a number; in metres?",
        )
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


def _explained(row: list[str], header: Sequence[str], where: str, faults: Faults) -> list[float]:
    """Numbers of a row that the quick conversion refused; notes every cell that is none."""
    numbers = []
    for name, cell in zip(header, row, strict=True):
        try:
            numbers.append(_cell(cell))
        except ValueError:
            faults.add(f"{where}, column {name!r}", cell, _not_a_number(cell.strip()))
            numbers.append(math.nan)
    return numbers


def _not_a_number(text: str) -> str:
    if text.lower().lstrip("+-") in {"inf", "infinity"}:
        return f"is {text!r}; it must be a finite number, or an empty cell where the marker was not seen"
    if text.lower() in _MISSING_WORDS:
        return f"is {text!r}; leave the cell empty where the marker was not seen"
    return f"is {shown(text)!r}; it must be a number, or an empty cell where the marker was not seen"


def _ragged(row: list[str], width: int) -> str:
    cause = "the line is cut off or lacks commas" if len(row) < width else "decimal commas, or a comma too many"
    return f"has {len(row)} cells where the header has {width}; {cause}"


def _check_size(rows: int, numbers: int, file: str, room: int) -> None:
    if rows > MAX_ROWS:
        raise fail(file, rows, f"has more than {MAX_ROWS} rows, the most that are read; cut the recording in parts")
    if numbers > room:
        raise too_much(file)


def too_much(where: str) -> DatasetError:
    """Make the error of a dataset with more numbers than fit."""
    message = f"the dataset holds more than {MAX_VALUES} numbers, the most that are read; split it or thin it out"
    return fail(where, None, message)
