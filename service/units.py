"""Converts SI units to the units of the API; infinity and NaN, which JSON does not have, become None (null)."""

from __future__ import annotations

import math

MM = 1e3
MN = 1e3
PASCAL_PER_MBAR = 100.0
ZERO_CELSIUS = 273.15


def mm(value: float | None) -> float | None:
    """Convert metres to millimetres; None for None, infinity or NaN."""
    return None if value is None else finite(value * MM)


def mn(value: float | None) -> float | None:
    """Convert newtons to millinewtons; None for None, infinity or NaN."""
    return None if value is None else finite(value * MN)


def tidy_mm(stated: float) -> float:
    """Convert a distance that a user entered in mm back from m to mm, without rounding errors: 0.07, not 0.070...01."""
    return round(stated * MM, 9)


def finite(value: float) -> float | None:
    """Return ``value``, or None if it is infinite or NaN."""
    return float(value) if math.isfinite(value) else None
