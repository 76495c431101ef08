"""Cross-sections of a wing: rigidity and mass, as functions of the span position.

Foam fills the section, a rectangle; skin lies on both faces; rods and foam are parallel springs (van der Grinten's
thesis, Eqs. 15-17). All vectors and axes are those of the wing at rest: x aft, y along the span, z up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.wing.geometry import Lump
from wingfit.records import Rod, Wing

Array = npt.NDArray[np.float64]

_ODD = np.arange(1, 40, 2)
_SOFTEST = 1e-3  # least fraction of the rigidity that remains


@dataclass(frozen=True)
class Mass:
    """Inertia of a slice of the wing about its point of the reference line, in the section's frame.

    ``mass`` kg; ``moment`` [3] first moment, kg m; ``inertia`` [3, 3] kg m^2.
    """

    mass: float
    moment: Array
    inertia: Array

    def __add__(self, other: Mass) -> Mass:
        return Mass(self.mass + other.mass, self.moment + other.moment, self.inertia + other.inertia)


def point_mass(mass: float, arm: Array) -> Mass:
    """A point mass (kg) at ``arm`` [3] (m) from the reference point."""
    return Mass(mass, mass * arm, mass * (arm @ arm * np.eye(3) - np.outer(arm, arm)))


def torsion_constant(width: float, thickness: float) -> float:
    """Torsion constant of a rectangle, m^4 (Timoshenko and Goodier, Theory of Elasticity (1951), Eq. 160)."""
    a, b = min(width, thickness), max(width, thickness)
    series = float(np.sum(np.tanh(_ODD * math.pi * b / (2 * a)) / _ODD**5))
    return a**3 * b / 3 * (1 - 192 / math.pi**5 * a / b * series)


class Sections:
    """Cross-sections of ``wing`` with the material of ``genome``: E_f, E_r, G_f, G_r (Pa), D_E, D_G (Pa s).

    ``factor`` multiplies stiffness and damping everywhere. Within each of ``notches``, (from, to, fraction) with span
    positions in m, they are reduced by the fraction.
    """

    def __init__(
        self,
        wing: Wing,
        genome: Mapping[str, float],
        factor: float = 1.0,
        notches: Sequence[tuple[float, float, float]] = (),
    ) -> None:
        self.wing, self.genome, self.factor, self.notches = wing, genome, factor, notches
        table = np.array([(s.y, s.leading_edge, s.chord, s.thickness) for s in wing.stations])
        self._y, self._columns = table[:, 0], table[:, 1:].T
        self.root, self.tip = float(self._y[0]), float(self._y[-1])

    @property
    def borders(self) -> Array:
        """Span positions (m) at which the properties, or their derivatives, jump; ascending, from root to tip."""
        rods = [end for rod in self.wing.rods for end in (rod.y_root, rod.y_tip)]
        cuts = [*self._y, *rods, *(end for notch in self.notches for end in notch[:2])]
        return np.unique(np.round(np.clip(cuts, self.root, self.tip), 9))

    def at(self, y: float) -> tuple[float, float, float]:
        """x of mid-chord, chord and thickness at the span position ``y``, all in m."""
        edge, chord, thickness = (float(np.interp(y, self._y, column)) for column in self._columns)
        return edge + 0.5 * chord, chord, thickness

    def line(self, y: float) -> Array:
        """Point [3] (m) of the reference line, the middle of the chord, at the span position ``y`` (m)."""
        return np.array([self.at(y)[0], y, 0.0])

    def rigidity(self, y: float, rods: Sequence[Rod] | None = None, share: float = 1.0) -> tuple[Array, Array]:
        """Rigidity [6] and damping [6] at ``y`` (m): about x, y, z (N m^2, N m^2 s), then along x, y, z (N, N s).

        ``rods``: those that are present, by default all that reach ``y``; ``share``: of the foam.
        """
        _, chord, h = self.at(y)
        area, genome = chord * h, self.genome
        foam = np.array([chord * h**3 / 12, torsion_constant(chord, h), h * chord**3 / 12, area, area, area])
        stretch, shear = np.array([1.0, 0, 1, 0, 1, 0]), np.array([0.0, 1, 0, 1, 0, 1])
        stiffness = share * foam * (genome["E_f"] * stretch + genome["G_f"] * shear)
        damping = share * foam * (genome["D_E"] * stretch + genome["D_G"] * shear)
        for rod in self._rods_at(y) if rods is None else rods:
            bending = genome["E_r"] * math.pi * rod.diameter**4 / 64
            shearing = genome["G_r"] * math.pi * rod.diameter**2 / 4
            stiffness += np.array([bending, 0.0, bending, shearing, 0.0, shearing])
        left = self.factor
        for start, end, fraction in self.notches:
            if start <= y <= end:
                left *= max(1 - fraction, _SOFTEST)
        return left * stiffness, left * damping

    def _rods_at(self, y: float) -> list[Rod]:
        return [rod for rod in self.wing.rods if rod.y_root <= y <= rod.y_tip]

    def mass(self, y: float) -> Mass:
        """Mass per length of span at ``y``, in kg/m and so on, of foam, skin and rods with their glue."""
        middle, chord, h = self.at(y)
        foam, skin = self.wing.materials.foam_density * h * chord, self.wing.materials.skin_areal_density * chord
        along, through = (foam + skin) * chord**2 / 12, foam * h**2 / 12 + skin * h**2 / 4
        found = Mass(foam + skin, np.zeros(3), np.diag([through, through + along, along]))
        for rod in self._rods_at(y):
            found += point_mass(per_span(rod), np.array([x_of(rod, y) - middle, 0.0, 0.0]))
        return found

    def points(self, lumps: Sequence[Lump]) -> list[tuple[float, Mass]]:
        """Span position (m) and mass of the slices with point masses: markers, ``lumps``, rods beyond root or tip."""
        found: dict[float, Mass] = {}
        carried = [Lump(marker.mass, marker.position) for marker in self.wing.markers] + list(lumps)
        for lump in [*carried, *(lump for rod in self.wing.rods for lump in self._beyond(rod))]:
            y, arm = self.arm(lump.place)
            found[y] = found.get(y, Mass(0.0, np.zeros(3), np.zeros((3, 3)))) + point_mass(lump.mass, arm)
        return sorted(found.items())

    def arm(self, place: Sequence[float] | Array) -> tuple[float, Array]:
        """Span position (m) of the section that carries the point ``place`` [3], and the point relative to its line."""
        y = float(np.clip(place[1], self.root, self.tip))
        return y, np.asarray(place, float) - self.line(y)

    def _beyond(self, rod: Rod) -> list[Lump]:
        """Point masses of the parts of ``rod`` inboard of the root and outboard of the tip."""
        nodes, weights = np.polynomial.legendre.leggauss(3)
        found = []
        for a, b in ((rod.y_root, min(self.root, rod.y_tip)), (max(self.tip, rod.y_root), rod.y_tip)):
            if b - a > 1e-9:
                for y, part in zip(0.5 * (a + b) + 0.5 * (b - a) * nodes, 0.5 * (b - a) * weights, strict=True):
                    found.append(Lump(float(part) * per_span(rod), (x_of(rod, float(y)), float(y), 0.0)))
        return found


def x_of(rod: Rod, y: float) -> float:
    """x (m) of ``rod`` at the span position ``y`` (m)."""
    return rod.x_root + (y - rod.y_root) * (rod.x_tip - rod.x_root) / (rod.y_tip - rod.y_root)


def per_span(rod: Rod) -> float:
    """Mass of ``rod`` with its glue per length of span, kg/m."""
    slope = (rod.x_tip - rod.x_root) / (rod.y_tip - rod.y_root)
    return (rod.density * math.pi / 4 * rod.diameter**2 + rod.glue_linear_density) * math.sqrt(1 + slope * slope)
