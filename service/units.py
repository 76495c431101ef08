"""Conversion from SI to the units of the API; numbers that JSON does not have become null."""

from __future__ import annotations

import math

MM = 1e3
MN = 1e3
PASCAL_PER_MBAR = 100.0
ZERO_CELSIUS = 273.15


def mm(value: float | None) -> float | None:
    """Metres to millimetres."""
    return None if value is None else finite(value * MM)


def mn(value: float | None) -> float | None:
    """Newtons to millinewtons."""
    return None if value is None else finite(value * MN)


def tidy_mm(stated: float) -> float:
    """A distance (m) that a user entered in mm, converted back to mm without rounding errors: 0.07, not 0.0700...01."""
    return round(stated * MM, 9)


def finite(value: float) -> float | None:
    """``value``, or None if it is infinite or not a number."""
    return float(value) if math.isfinite(value) else None
