"""Areas and second moments of rectangular cross sections and of round rods."""

from __future__ import annotations

import math
from dataclasses import dataclass

_TERMS = 12


@dataclass(frozen=True)
class Rectangle:
    """Rectangular cross section ``width`` x ``thickness`` (m) of the foam between two bodies."""

    width: float
    thickness: float

    @property
    def area(self) -> float:
        """Area, m^2."""
        return self.width * self.thickness

    @property
    def flapwise(self) -> float:
        """Second moment of area for bending out of the wing's plane, width thickness^3 / 12, m^4."""
        return self.width * self.thickness**3 / 12

    @property
    def inplane(self) -> float:
        """Second moment of area for bending in the wing's plane, thickness width^3 / 12, m^4."""
        return self.thickness * self.width**3 / 12

    @property
    def torsion(self) -> float:
        """Saint-Venant torsion constant, m^4, by its series, to 1e-6 (Timoshenko and Goodier, section 109)."""
        ratio = max(self.width, self.thickness) / min(self.width, self.thickness)
        odd = range(1, 2 * _TERMS, 2)
        series = sum(math.tanh(0.5 * math.pi * n * ratio) / n**5 for n in odd)
        return self.area * min(self.width, self.thickness) ** 2 / 3 * (1 - 192 / math.pi**5 / ratio * series)


def round_area(diameter: float) -> float:
    """Cross-sectional area of a round rod of ``diameter`` (m), m^2."""
    return math.pi * diameter**2 / 4


def round_second_moment(diameter: float) -> float:
    """Second moment of area of a round rod of ``diameter`` (m) about a diameter, m^4."""
    return math.pi * diameter**4 / 64
