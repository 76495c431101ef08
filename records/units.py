"""Exact conversion between the units of the files (deg, mbar, Celsius) and SI.

Not every double in radians is the conversion of a double in degrees. A number in a file is therefore read as a decimal,
converted in long arithmetic and rounded once, and it is written with the fewest digits (up to 18) that convert back to
the same double. So writing and reading is exact.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from decimal import Context, Decimal

_LONG = Context(prec=60, Emin=-999_999, Emax=999_999)
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")


@dataclass(frozen=True)
class Unit:
    """A unit used in files: SI value = ``factor`` x value in this unit + ``offset``."""

    factor: Decimal = Decimal(1)
    offset: Decimal = Decimal(0)


SI = Unit()
DEG = Unit(_LONG.divide(_PI, Decimal(180)))
MBAR = Unit(Decimal(100))
CELSIUS = Unit(offset=Decimal("273.15"))


def to_si(value: Decimal, unit: Unit = SI) -> float:
    """Convert ``value`` from ``unit`` to SI, rounded once, to the nearest double."""
    if unit == SI:
        return float(value)
    scaled = _LONG.multiply(value, unit.factor)
    # Adding a zero offset would turn -0 into 0.
    return float(_LONG.add(scaled, unit.offset) if unit.offset else scaled)


def from_si(value: float, unit: Unit = SI) -> Decimal:
    """Return the shortest decimal in ``unit`` that :func:`to_si` converts back to the SI ``value``, bit for bit."""
    value = float(value)
    if unit == SI or not math.isfinite(value):
        return Decimal(repr(value))
    exact = _LONG.divide(_LONG.subtract(Decimal(value), unit.offset), unit.factor)
    candidates = (Decimal(0), Decimal("-0"), *(Context(prec=n).plus(exact) for n in range(1, 40)))
    # No candidate fits only for temperatures close to absolute zero, which the format refuses.
    bits = struct.pack("<d", value)  # unlike ==, they distinguish -0 from 0
    return next((candidate for candidate in candidates if struct.pack("<d", to_si(candidate, unit)) == bits), exact)


def number_text(value: Decimal) -> str:
    """Return ``value`` as text that both YAML 1.1 and YAML 1.2 read as a number."""
    text = repr(float(value))
    if Decimal(text) != value:
        text = str(value).lower()
    mantissa, _, exponent = text.partition("e")
    if exponent and "." not in mantissa:
        mantissa += ".0"
    return f"{mantissa}e{exponent}" if exponent else mantissa
