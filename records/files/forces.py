"""Reads the forces of one recording from CSV with the columns ``time_s``, and ``force_x_n``, ``force_z_n`` or both."""

from __future__ import annotations

import re
from collections.abc import Sequence

from wingfit.records.dataset import ForceAxis
from wingfit.records.errors import fail
from wingfit.records.files.table import Layout, Samples, read_columns, read_table
from wingfit.records.limits import MAX_VALUES

AXES: tuple[ForceAxis, ...] = ("x", "z")
_COLUMNS = {f"force_{axis}_n": axis for axis in AXES}
_FORCE = re.compile(r"(?:forces?|f)?_?(?P<axis>[xyz])(?:_?(?P<unit>n|mn|un|kn|gf?|kgf?|lbf|newtons?))?", re.IGNORECASE)
_GRAM, _KILOGRAM = "1 gram-force = 0.00980665 N", "1 kilogram-force = 9.80665 N"
_IN_NEWTONS = {
    "mn": "1 mN = 0.001 N", "un": "1 uN = 1e-6 N", "kn": "1 kN = 1000 N", "lbf": "1 lbf = 4.44822 N",
    "g": _GRAM, "gf": _GRAM, "kg": _KILOGRAM, "kgf": _KILOGRAM,
}  # fmt: skip
_WIND_AXES = re.compile(r"(?:lift|drag|thrust)(?:_?[a-z]+)?", re.IGNORECASE)


def read_forces(raw: bytes, file: str, room: int = MAX_VALUES) -> Samples:
    """Read forces from the contents ``raw`` of a CSV ``file`` with at most ``room`` numbers.

    The channels are in the order x, z, whatever the order of the columns. DatasetError names line and column of errors.
    """
    return read_table(raw, file, _layout, room, "nothing was measured")


def _layout(header: Sequence[str], where: str) -> Layout:
    columns = read_columns(header, where, _problem)
    found = [(name, axis) for name, axis in _COLUMNS.items() if name in columns]
    if not found:
        raise fail(where, ",".join(header), f"there is no column of forces; add {' or '.join(_COLUMNS)}, or both")
    return Layout(columns["time_s"], [columns[name] for name, _ in found], forces=tuple(axis for _, axis in found))


def _problem(name: str) -> str | None:
    if name in _COLUMNS:
        return None
    if _WIND_AXES.fullmatch(name):
        return (
            f"unknown column {name!r}; give forces in body axes (x to the nose, z down) with the body pitch theta: "
            "X = lift sin(theta) - drag cos(theta), Z = -lift cos(theta) - drag sin(theta)"
        )
    other = _FORCE.fullmatch(name)
    if other and other["axis"] in "yY":
        return f"unknown column {name!r}; a side force is not modelled: remove the column"
    if other:
        factor = _IN_NEWTONS.get((other["unit"] or "").lower())
        unit = f"newtons ({factor})" if factor else "newtons"
        return f"unknown column {name!r}; write 'force_{other['axis'].lower()}_n', with forces in {unit}"
    return f"unknown column {name!r}; columns are time_s, {', '.join(_COLUMNS)}: remove what is none of them"
