"""Channels of a balance as they are in the file, and what their names say: axis or wind axis, and unit."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from wingfit.importers.raw import Stated
from wingfit.records.array_types import Array, Float, Index, Int

# Newtons per unit.
FORCE_UNITS = {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "kN": 1e3, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605}
ROLES = ("fx", "fy", "fz", "lift", "drag", "thrust")
_WORDS = {
    "newton": "N", "newtons": "N", "n": "N", "mn": "mN", "un": "uN", "µn": "uN", "μn": "uN", "kn": "kN",
    "millinewton": "mN", "millinewtons": "mN", "gf": "gf", "gram-force": "gf", "grams-force": "gf", "p": "gf",
    "kgf": "kgf", "kp": "kgf", "lbf": "lbf", "lbs": "lbf", "pound-force": "lbf",
}  # fmt: skip
_UNIT = r"(?:(?:[\s_./]+|(?=[\[(]))[\[(]?\s*(?P<unit>[A-Za-zµμ][A-Za-zµμ-]{0,14})\s*[\])]?)?"
_FORCE = re.compile(rf"(?:forces?|f)[\s_.\-]*(?P<axis>[xyz]){_UNIT}", re.IGNORECASE)
_WIND = re.compile(rf"(?P<axis>lift|drag|thrust)(?:[\s_.\-]*force)?{_UNIT}", re.IGNORECASE)
_TIME = re.compile(
    r"(?:time|times|timestamp|t|seconds|sec)(?:[\s_.]*[\[(]?(?P<unit>seconds|sec|s|ms|us|µs)[\])]?)?", re.IGNORECASE
)
_TIME_UNITS = {"seconds": "s", "sec": "s", "s": "s", "ms": "ms", "us": "us", "µs": "us"}
_LONGEST = 100


@dataclass(eq=False)
class Channels:
    """What a reader returns.

    Attributes:
        values: numbers [T] of each channel of force by its role ("fx", "lift", ...); NaN for a gap.
        names: name of each of these channels in the file.
        units: unit of a channel as the file writes it, where it does.
        lines: [T], line or number of each sample, for messages.
        line_word: what ``lines`` counts.
        times: [T] as in the file, None if it has none.
        time_unit: unit of ``times``.
        times_where: place of ``times``.
        rates: samples per second that the file states.
        title: kind of the file.
        remarks: what was not read.
    """

    values: dict[str, Float[Array, " T"]]
    names: dict[str, str]
    units: dict[str, Stated[str]]
    lines: Int[Index, " T"]
    line_word: str = "line"
    times: Float[Array, " T"] | None = None
    time_unit: Stated[str] | None = None
    times_where: str = ""
    rates: list[Stated[float]] = field(default_factory=list)
    title: str = "table"
    remarks: list[str] = field(default_factory=list)


def role_of(name: str) -> tuple[str, str] | None:
    """Return the role of a channel called ``name`` and the unit in the name ("" if none); None if it is no force."""
    if len(name) > _LONGEST:
        return None
    if match := _FORCE.fullmatch(name.strip()):
        return f"f{match['axis'].lower()}", match["unit"] or ""
    if match := _WIND.fullmatch(name.strip()):
        return match["axis"].lower(), match["unit"] or ""
    return None


def time_unit_of(name: str) -> tuple[bool, str | None]:
    """Return whether ``name`` is that of a channel of times, and the unit in it ("s", "ms", "us"; None if none)."""
    match = _TIME.fullmatch(name.strip()) if len(name) <= _LONGEST else None
    if match is None:
        return False, None
    return True, _TIME_UNITS[match["unit"].lower()] if match["unit"] else None


def force_unit(text: str) -> str | None:
    """Return the key of FORCE_UNITS that ``text`` names; None if it is unknown. Milli and mega differ by case."""
    word = text.strip().strip("()[]")
    if word in ("MN", "Mn"):
        return None
    return _WORDS.get(word.lower())
