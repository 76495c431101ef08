"""A plain table with any header: comma-, semicolon- or tab-separated, one row per frame.

Columns of markers are found by their names, if these end or start with an axis: tip_x, tip.X, "tip x", x_tip, tip_x_mm,
"tip_x (mm)", tip_xyz_1. Columns x, y, z alone are one marker. With any other names, the option ``--columns`` says which
column is what: "time=t; tip=a,b,c; root=d,e,f". A column of times is called time, t or timestamp, with its unit
(time_s, "t (ms)") or not; a column frame counts frames. All other columns are ignored, and listed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from wingfit.importers.numbers import Layout, number_of, read_samples, separated_by
from wingfit.importers.options import Given, ask, pairs_of, unit_of
from wingfit.importers.raw import Raw, Reader, Stated, raw_of
from wingfit.importers.rows import row_choices
from wingfit.importers.source import Source, separator_of
from wingfit.records.errors import DatasetError, Faults, counted, fail, nearest

_UNIT = r"(?:[\s_.]*[\[(]?(?P<unit>mm|cm|um|µm|m|in|ft|px)[\])]?)?"
# How the name of a column of a marker ends, or starts, with its axis; each is found in a time linear in the length of
# the name, as the names of an upload are not trusted.
_NUMBERED = re.compile(rf"_xyz_(?P<axis>[123]){_UNIT}\Z", re.IGNORECASE)
_AT_END = re.compile(rf"(?P<axis>[xyz]){_UNIT}\Z", re.IGNORECASE)
_AT_START = re.compile(r"(?P<axis>[xyz])[\s_.:\-]+", re.IGNORECASE)
_END = re.compile(rf"{_UNIT}\Z", re.IGNORECASE)
_BETWEEN = re.compile(r"[\s_.:\-]")  # characters between a marker and its axis
_TIME = re.compile(
    r"(?:time|times|timestamp|t|seconds|sec)(?:[\s_.]*[\[(]?(?P<unit>seconds|sec|s|ms|us|µs)[\])]?)?", re.IGNORECASE
)
_FRAME = re.compile(r"(?:frame|frames|fnum|frame[\s_]?(?:no|nr|number|index|idx)\.?|frame#)", re.IGNORECASE)
_TIME_UNITS = {"seconds": "s", "sec": "s", "s": "s", "ms": "ms", "us": "us", "µs": "us"}
_EXAMPLE = "time=t; tip=a,b,c; root=d,e,f"
_LISTED = 6
_LONGEST = 200  # characters in the name of a column; matching longer ones takes long
ONLY_MARKER = "marker"


@dataclass
class _Found:
    """Columns by use: ``markers`` {label: the three columns}, ``time``, ``frame``, and what their names state."""

    markers: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    time: int | None = None
    frame: int | None = None
    time_unit: str | None = None
    units: set[str] = field(default_factory=set)
    unit_examples: dict[str, str] = field(default_factory=dict)  # a marker for each of the units


def recognises(source: Source) -> bool:
    """Return whether the file is a text: a plain table is what no other reader recognises."""
    return source.encoding is not None


def read(source: Source, given: Given) -> Raw:
    """Return the tracks of a plain table; DatasetError names line, column and remedy."""
    line = next((n for n in range(1, len(source.head) + 1) if any(source.cells(n))), None)
    if line is None:
        none = f"none of the first {len(source.head)} lines is a row of a table" if any(source.head) else "is empty"
        raise fail(source.file, None, f"{none}; the file needs a header and rows of numbers")
    separator = separator_of(source.head[line - 1])
    header = source.cells(line, separator)
    _check_header(source, header, line, separator)
    found = _by_name(source, header, line) if given.columns is None else _by_option(source, header, given.columns)
    layout = Layout([*found.markers], [*found.markers.values()], header, time=found.time, frame=found.frame)
    keep = None if given.rows is None else _row_filter(source, header, line, given.rows)
    raw = raw_of(layout, read_samples(source.rows(separator, line + 1), layout, source, given.decimal, keep))
    if found.time is not None:
        raw.times_where = f"column {header[found.time]!r}"
        raw.time_unit = Stated(found.time_unit, f"line {line}, {raw.times_where}") if found.time_unit else None
    if found.units:
        raw.unit = Stated(found.units.pop(), f"line {line}, names of the columns")
    used = {column for place in found.markers.values() for column in place} | {found.time, found.frame}
    ignored = [name for index, name in enumerate(header) if index not in used and name]
    if ignored:
        raw.remarks.append(f"not imported: {_listed(ignored)}")
        raw.row_choices = lambda order: row_choices(
            source.rows(separator, line + 1), raw.lines, header, ignored, order, given.rows
        )
    return raw


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"column{'s' if len(names) > 1 else ''} {', '.join(names[:_LISTED])}{more}"


def _check_header(source: Source, header: list[str], line: int, separator: str) -> None:
    """Raise DatasetError if ``header`` is no row of different names."""
    numbers = sum(_is_number(cell) for cell in header)
    if numbers > len(header) / 2:
        message = "holds numbers instead of names; add a header such as time_s,tip_x_m,tip_y_m,tip_z_m"
        raise fail(source.at(line), header[0], message)
    if len(header) == 1:
        message = f"has one column; separate columns by commas, semicolons or tabs (here: {separated_by(separator)})"
        raise fail(source.at(line), header[0], message)
    faults, seen = Faults(), dict[str, int]()
    for index, name in enumerate(header):
        if name and name in seen:
            faults.add(source.at(line, index + 1), name, f"column {name!r} is also column {seen[name] + 1}; rename one")
        seen.setdefault(name, index)
    faults.raise_any()


def _is_number(cell: str) -> bool:
    try:
        return number_of(cell) == number_of(cell)
    except ValueError:
        return False


def _by_name(source: Source, header: list[str], line: int) -> _Found:
    """Return the use of each column by its name; DatasetError says why no marker can be recognised."""
    found, faults = _Found(), Faults()
    groups: dict[tuple[int, str, str], dict[str, int]] = {}
    for index, name in enumerate(header):
        if _special(found, name, index, source.at(line, index + 1), faults):
            continue
        for kind, (marker, axis, unit) in _meanings(name) if len(name) <= _LONGEST else ():
            axis = axis.lower().translate(str.maketrans("123", "xyz"))
            groups.setdefault((kind, marker, (unit or "").lower()), {}).setdefault(axis, index)
    _complete(found, groups, header, source.at(line), faults)
    faults.raise_any()
    if not found.markers:
        raise _no_marker(source, header, line, groups)
    if len(found.units) > 1:
        listed = ", ".join(sorted(unit or "none" for unit in found.units))
        examples = ", ".join(f"{header[found.markers[label][0]]!r}" for label in found.unit_examples.values())
        message = f"the columns of markers state the units {listed} (as in {examples}); write all in one unit"
        raise fail(source.at(line), listed, message)
    found.units.discard("")
    return found


def _meanings(name: str) -> Iterator[tuple[int, tuple[str, str, str | None]]]:
    """Yield what a column called ``name`` may be: the kind of name, and marker, axis and unit."""
    if (found := _NUMBERED.search(name, 1)) and (marker := _stripped(name[: found.start()])):
        yield 0, (marker, found["axis"], found["unit"])
    if found := _AT_END.search(name):
        yield 1, (_stripped(name[: found.start()]) or ONLY_MARKER, found["axis"], found["unit"])
    if (found := _AT_START.match(name)) and found.end() < len(name):
        end = _END.search(name, found.end() + 1)
        assert end is not None  # noqa: S101  # it matches the end of any text
        yield 2, (name[found.end() : end.start()], found["axis"], end["unit"])


def _stripped(name: str) -> str:
    """Return ``name`` without the characters at its end that separate marker and axis."""
    end = len(name)
    while end and _BETWEEN.match(name[end - 1]):
        end -= 1
    return name[:end]


def _special(found: _Found, name: str, index: int, where: str, faults: Faults) -> bool:
    """Return whether ``name`` is that of a column of times or frames, which is then added to ``found``."""
    if match := _TIME.fullmatch(name):
        if found.time is not None:
            faults.add(where, name, f"{name!r} is a second column of times; choose with --columns {_EXAMPLE!r}")
        unit = match["unit"] or (name if name.lower() in ("seconds", "sec") else None)
        found.time, found.time_unit = index, _TIME_UNITS[unit.lower()] if unit else None
        return True
    if _FRAME.fullmatch(name):
        if found.frame is not None:
            faults.add(where, name, f"{name!r} is a second column of frames; choose with --columns {_EXAMPLE!r}")
        found.frame = index
        return True
    return False


def _complete(
    found: _Found, groups: dict[tuple[int, str, str], dict[str, int]], header: list[str], where: str, faults: Faults
) -> None:
    """Add the groups that have x, y and z to ``found``; a group with two of them is a fault if others have three."""
    used = set[int]()
    for (_, label, unit), columns in groups.items():
        places = set(columns.values())
        if len(columns) == 3 and not used & places:
            if label in found.markers:
                faults.add(where, label, f"two markers are called {label!r}; rename the columns of one")
            found.markers[label] = (columns["x"], columns["y"], columns["z"])
            found.units.add(known := unit_of(unit) or "" if unit else "")
            found.unit_examples.setdefault(known, label)
            used |= places
    alike: dict[tuple[int, str], list[dict[str, int]]] = {}
    for (kind, label, _unit), columns in groups.items():
        alike.setdefault((kind, label), []).append(columns)
    for (kind, label, _unit), columns in groups.items():
        others = [more for more in alike[kind, label] if more is not columns]
        together = set(columns).union(*others)
        if len(columns) < 3 and together == set("xyz") and not used & set(columns.values()):
            used |= {at for group in (columns, *others) for at in group.values()}
            names = [header[at] for at in sorted(at for group in (columns, *others) for at in group.values())]
            message = f"the columns of marker {label!r} state different units ({', '.join(names)})"
            faults.add(where, label, f"{message}; write all in one unit, and name them so")
    for (_, label, _unit), columns in groups.items():
        if found.markers and len(columns) == 2 and not used & set(columns.values()):
            missing = next(axis for axis in "xyz" if axis not in columns)
            faults.add(where, label, f"marker {label!r} has no column for {missing}; add it, or rename the two others")


def _no_marker(
    source: Source, header: list[str], line: int, groups: dict[tuple[int, str, str], dict[str, int]]
) -> DatasetError:
    flat = [label for (_, label, _), columns in groups.items() if set(columns) == {"x", "y"}]
    if flat:
        message = f"{flat[0]!r} has x and y but no z: tracks of one camera; triangulate first, and import 3-D tracks"
        return fail(source.at(line), flat[0], message)
    message = (
        f"no columns of markers are recognised in {_listed([name for name in header if name])}; name them like "
        f"tip_x_m,tip_y_m,tip_z_m, or say which they are: --columns {_EXAMPLE!r}"
    )
    return ask("columns", source.at(line), None, message, [name for name in header if name])


def _by_option(source: Source, header: list[str], text: str) -> _Found:
    """Return the use of the columns as the option ``--columns`` states it."""
    found, faults = _Found(), Faults()
    place = {name: index for index, name in enumerate(header) if name}
    for label, value in pairs_of("--columns", text, ";", _EXAMPLE):
        names = [name.strip() for name in value.split(",")]
        for name in names:
            if name not in place and not faults.full:
                faults.add("--columns", name, f"{source.file} has no column {name!r}; {nearest(name, header)}")
        if label in ("time", "frame") and len(names) == 1:
            column = place.get(names[0])
            found.time = column if label == "time" else found.time
            found.frame = column if label == "frame" else found.frame
            match = _TIME.fullmatch(names[0]) if label == "time" else None
            found.time_unit = _TIME_UNITS[match["unit"].lower()] if match and match["unit"] else found.time_unit
        elif len(names) != 3:
            faults.add(
                "--columns", value, f"{label!r} has {counted(len(names), 'column')}; give three, those of x, y and z"
            )
        elif label in found.markers:
            faults.add("--columns", label, f"names {label!r} twice; keep one")
        elif all(name in place for name in names):
            found.markers[label] = (place[names[0]], place[names[1]], place[names[2]])
    faults.raise_any()
    if not found.markers:
        raise fail("--columns", text, f"names no marker; write it like {_EXAMPLE!r}")
    return found


def _row_filter(source: Source, header: list[str], line: int, text: str) -> Callable[[list[str]], bool]:
    """Return a function of the cells of a row: whether they have the values that the option ``--rows`` states."""
    wanted = []
    for name, value in pairs_of("--rows", text, ",", "sequence=3,side=left"):
        if name not in header:
            raise fail("--rows", name, f"{source.at(line)} has no column {name!r}; {nearest(name, header)}")
        wanted.append((header.index(name), value))
    return lambda cells: all(cells[index].strip() == value for index, value in wanted)


READER = Reader("plain", "plain table", recognises, read)
