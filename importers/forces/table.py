"""Reads the channels of a balance from a table: any header, lines above it, a line of units.

The header is the first line with a name of a force (Fx, force_z_mN, "Lift (N)", ...), or with the names that
``--columns`` states.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from wingfit.importers.forces.channels import ROLES, Channels, force_unit, role_of, time_unit_of
from wingfit.importers.numbers import number_of, read_columns
from wingfit.importers.options import TIME_UNITS, Decimal, pairs_of
from wingfit.importers.raw import Stated
from wingfit.importers.source import SEPARATORS, Source
from wingfit.records.errors import Faults, fail, nearest

_EXAMPLE = "time=t; fx=ch1; fz=ch3"
_BRACKETS = re.compile(r"[\[(]\s*(.*?)\s*[\])]")


def read_table(source: Source, columns: str | None, decimal: Decimal) -> Channels:
    """Return the channels in a table; DatasetError names line, column and remedy."""
    asked = _asked(columns) if columns else None
    line, separator, header = _header(source, asked)
    roles, units, time, time_unit = _named(source, header, line) if asked is None else _chosen(header, asked)
    below = source.cells(line + 1, separator)
    has_units = len(below) >= 2 and any(below) and not any(_is_number(cell, decimal) for cell in below)
    where = f"line {line}, names of the columns"
    stated = {role: Stated(unit, where) for role, unit in units.items() if unit}
    if has_units:
        for role, index in roles.items():
            text = _BRACKETS.sub(r"\1", below[index]) if index < len(below) else ""
            if text and role not in stated:
                stated[role] = Stated(text, f"line {line + 1}, units")
        if time is not None and time_unit is None and time < len(below):
            text = _BRACKETS.sub(r"\1", below[time]).lower()
            time_unit = {"sec": "s", "seconds": "s"}.get(text, text if text in TIME_UNITS else None)
    wanted = [*roles.values(), *([] if time is None else [time])]
    start = line + 2 if has_units else line + 1
    numbers, lines = read_columns(source.rows(separator, start), wanted, header, source, decimal)
    ignored = [name for k, name in enumerate(header) if k not in wanted and name]
    remarks = [f"not imported: {', '.join(ignored[:8])}{', ...' if len(ignored) > 8 else ''}"] if ignored else []
    if line > 1:
        remarks.append(f"{line - 1} lines above the header are not read")
    return Channels(
        values={role: numbers[:, k] for k, role in enumerate(roles)},
        names={role: header[index] for role, index in roles.items()},
        units=stated,
        lines=lines,
        times=None if time is None else numbers[:, -1],
        time_unit=None if time_unit is None else Stated(time_unit, where),
        times_where="" if time is None else f"column {header[time]!r}",
        remarks=remarks,
    )


def _asked(columns: str) -> dict[str, str]:
    """Return the names of columns by role, as ``--columns`` states them."""
    asked, known = dict[str, str](), ("time", *ROLES)
    for role, name in pairs_of("--columns", columns, ";", _EXAMPLE):
        if role.lower() not in known:
            raise fail("--columns", role, f"{role!r} is none of {', '.join(known)}; {nearest(role.lower(), known)}")
        asked[role.lower()] = name
    if not set(asked) & set(ROLES):
        raise fail("--columns", columns, f"names no force; write it like {_EXAMPLE!r}")
    return asked


def _header(source: Source, asked: dict[str, str] | None) -> tuple[int, str, list[str]]:
    """Return the line, the separator and the names of the header."""
    for line in range(1, len(source.head) + 1):
        for separator in sorted(SEPARATORS, key=source.head[line - 1].count, reverse=True):
            cells = source.cells(line, separator)
            if asked is None and any(role_of(cell) for cell in cells):
                return line, separator, cells
            if asked is not None and set(asked.values()) <= set(cells):
                return line, separator, cells
    if asked is not None:
        cells_of = (source.cells(line) for line in range(1, len(source.head) + 1))
        known = {cell for cells in cells_of for cell in cells if cell and not _is_number(cell, "point")}
        missing = next((name for name in asked.values() if name not in known), next(iter(asked.values())))
        message = f"no line of the first {len(source.head)} has all columns {', '.join(asked.values())}"
        raise fail("--columns", missing, f"{message}; {missing!r}: {nearest(missing, sorted(known))}")
    message = (
        f"no line of the first {len(source.head)} names a force (Fx, Fz, lift, drag, thrust, with or without a unit); "
        f"say which column is what: --columns {_EXAMPLE!r}"
    )
    raise fail(source.file, None, message)


def _named(
    source: Source, header: Sequence[str], line: int
) -> tuple[dict[str, int], dict[str, str], int | None, str | None]:
    """Return the columns of forces by role, the units in their names, the column of times and its unit."""
    roles, units, faults = dict[str, int](), dict[str, str](), Faults()
    time, time_unit = None, None
    for index, name in enumerate(header):
        is_time, unit = time_unit_of(name)
        if is_time and time is None:
            time, time_unit = index, unit
        elif found := role_of(name):
            role, unit_text = found
            if role in roles:
                message = (
                    f"is a second column of {role}, beside {header[roles[role]]!r}; say which: --columns {_EXAMPLE!r}"
                )
                faults.add(source.at(line, index + 1), name, message)
            roles.setdefault(role, index)
            units.setdefault(role, unit_text)
    faults.raise_any()
    return roles, units, time, time_unit


def _chosen(
    header: Sequence[str], asked: dict[str, str]
) -> tuple[dict[str, int], dict[str, str], int | None, str | None]:
    roles = {role: header.index(name) for role, name in asked.items() if role != "time"}
    units = {}
    for role, index in roles.items():
        bracket = _BRACKETS.search(header[index])
        found = role_of(header[index])
        units[role] = bracket[1] if bracket and force_unit(bracket[1]) else found[1] if found else ""
    if "time" not in asked:
        return roles, units, None, None
    return roles, units, header.index(asked["time"]), time_unit_of(asked["time"])[1]


def _is_number(cell: str, decimal: Decimal) -> bool:
    try:
        value = number_of(cell, decimal)
    except ValueError:
        return False
    return bool(np.isfinite(value))
