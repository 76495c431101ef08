"""Rounds forces, percentages and correlations as the web page does (service/web/base/format.js)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

SMALLEST, LARGEST = 1e-4, 1e6  # beyond, a power of ten is easier to read
NEAREST_ONE = 0.99995  # rounds to 1 with four decimals
ROUNDING = 1e-9  # error of the computed correlation of a series with itself


def rounded(value: float | None, digits: int = 3) -> str:
    """Return ``value`` with ``digits`` significant digits, trailing zeros kept: 0.0500, 12.0, 385; a dash for None."""
    if value is None:
        return "–"
    if value == 0:
        return "0"
    power = int(f"{value:.{digits - 1}e}".split("e")[1])
    if not SMALLEST <= 10.0**power < LARGEST:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(digits - 1 - power, 0)}f}"


def correlation(value: float | None) -> str:
    """Return a correlation with four decimals; ">0.9999" instead of 1.0000 unless it is exactly 1; a dash for None."""
    if value is None:
        return "–"
    if NEAREST_ONE <= value < 1 - ROUNDING:
        return ">0.9999"
    return f"{round(value, 4) + 0.0:.4f}"


@dataclass(frozen=True)
class Unit:
    """A unit in which the values of one table are shown; ``per_si_unit`` is its number per SI unit (mN: 1000)."""

    name: str
    per_si_unit: float

    def show(self, value: float | None, digits: int = 3) -> str:
        """Return ``value`` (SI unit) converted to this unit, as text without the unit's name; a dash for None."""
        return rounded(None if value is None else self.per_si_unit * value, digits)


UNITS = ((10.0, Unit("N", 1.0)), (1e-3, Unit("mN", 1e3)), (0.0, Unit("µN", 1e6)))


def force_unit(newtons: Iterable[float | None]) -> Unit:
    """Return the unit for the largest of ``newtons``: N from 10 N, mN from 1 mN and for no values, else µN."""
    largest = max((abs(value) for value in newtons if value), default=1.0)
    if not math.isfinite(largest):
        largest = 1.0
    return next(unit for least, unit in UNITS if largest >= least)


def with_unit(newtons: float, digits: int = 3) -> str:
    """Return one force (N) as text in a suitable unit, e.g. "12.0 mN"."""
    unit = force_unit([newtons])
    return f"{unit.show(newtons, digits)} {unit.name}"
