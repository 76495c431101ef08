"""Division of a wing into rigid bodies: masses, inertias, areas, and the body of each marker.

Computed from the description in ``records.Wing``, without code of the simulator that is tested.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wingfit.records import Wing

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_NAMED = {"4": [1] * 4, "11": [3, 3, 3, 2], "24": [4] * 6}
_SAMPLES = 3000  # points along a rod, whose mass is added to the bodies at these points
_GAUSS = 4  # Gauss points per stretch; exact because planform and thickness are linear in it


def counts_of(division: str) -> tuple[int, ...]:
    """Number of bodies along the chord of every strip, from the root; ValueError for an invalid division.

    A preset ("4", "11", "24"), "STRIPSxBODIES" such as "8x4", or a list such as "3,3,3,2".
    """
    try:
        if division in _NAMED:
            return tuple(_NAMED[division])
        if "x" in division:
            strips, along = map(int, division.split("x"))
            counts = [along] * strips
        else:
            counts = [int(part) for part in division.split(",")]
    except ValueError:
        counts = []
    if len(counts) < 2 or min(counts) < 1:
        raise ValueError(f"division {division!r} is invalid; write 4, 11, 24, 8x4 or 3,3,3,2")
    return tuple(counts)


@dataclass(frozen=True)
class Lump:
    """A point mass (kg) at (x, y, z) in the wing frame, m."""

    mass: float
    place: tuple[float, float, float]


class Cut:
    """A wing divided into bodies, with additional point masses ``lumps``.

    Its mass lies further aft than described by ``aft`` (m) at a mean chord, by the same fraction of every chord.

    Attributes:
        counts: [S] bodies along the chord of each strip; ``start`` [S + 1]: first body of each strip.
        strip: [N] strip of each body.
        s0, s1: [N] fractions of the chord between which a body lies.
        edges: [S + 1] span positions y of the strips' borders, m.
    """

    def __init__(self, wing: Wing, division: str, lumps: Sequence[Lump] = (), aft: float = 0.0) -> None:
        self.wing, self.counts, self.lumps, self.aft = wing, counts_of(division), tuple(lumps), aft
        table = np.array([(s.y, s.leading_edge, s.chord, s.thickness) for s in wing.stations])
        self._y, self._sections = table[:, 0], table[:, 1:]
        self.edges = np.linspace(self._y[0], self._y[-1], len(self.counts) + 1)
        self.strip = np.repeat(np.arange(len(self.counts)), self.counts)
        self.start = np.concatenate([[0], np.cumsum(self.counts)]).astype(np.int64)
        self.s0 = np.concatenate([np.arange(n) / n for n in self.counts])
        self.s1 = np.concatenate([(np.arange(n) + 1) / n for n in self.counts])

    def section(self, y: float) -> tuple[float, float, float]:
        """x of the leading edge, chord and thickness at span position ``y``, all in m."""
        edge, chord, thickness = (float(np.interp(y, self._y, column)) for column in self._sections.T)
        return edge, chord, thickness

    def x_at(self, part: float, y: float) -> float:
        """x (m) at the fraction ``part`` of the chord at span position ``y`` (m)."""
        edge, chord, _ = self.section(y)
        return edge + part * chord

    def place(self, span: float, chord: float) -> tuple[float, float]:
        """Position (x, y) in the wing frame (m) at given fractions of span and chord."""
        y = float(self.edges[0] + span * (self.edges[-1] - self.edges[0]))
        return self.x_at(chord, y), y

    def under(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Index:
        """Numbers [P] of the bodies at the points (``x``, ``y``) (m); on a border, the outer or rear body."""
        xs, ys = np.atleast_1d(np.asarray(x, float)), np.atleast_1d(np.asarray(y, float))
        strip = np.clip(np.searchsorted(self.edges, ys, side="right") - 1, 0, len(self.counts) - 1)
        edge, chord = np.interp(ys, self._y, self._sections[:, 0]), np.interp(ys, self._y, self._sections[:, 1])
        count = np.array(self.counts)[strip]
        along = np.clip(((xs - edge) / chord * count).astype(np.int64), 0, count - 1)
        return np.asarray(self.start[strip] + along, np.int64)

    def _stretches(self, strip: int) -> tuple[Array, Array]:
        """Gauss points y and weights (m) over the width of ``strip``, for each interval between stations in turn."""
        inner, outer = self.edges[strip], self.edges[strip + 1]
        cuts = np.unique(np.concatenate([[inner, outer], self._y[(self._y > inner) & (self._y < outer)]]))
        nodes, weights = np.polynomial.legendre.leggauss(_GAUSS)
        half = 0.5 * np.diff(cuts)[:, None]
        return (half * nodes + 0.5 * (cuts[1:] + cuts[:-1])[:, None]).ravel(), (half * weights).ravel()

    @cached_property
    def area(self) -> Array:
        """[N] planform area of each body, m^2."""
        return np.array([self._plan(n)[0].sum() for n in range(len(self.strip))])

    @cached_property
    def centroid(self) -> Array:
        """[N, 2] centroid of each body's planform, wing frame, m."""
        return np.array([w @ np.stack([x, y], axis=1) / w.sum() for w, x, y, _ in map(self._plan, range(len(self.s0)))])

    def _plan(self, n: int) -> tuple[Array, Array, Array, Array]:
        """Area weights (m^2), x, y and thickness (m) at the Gauss points of body ``n``, flat arrays."""
        y, weight = self._stretches(int(self.strip[n]))
        edge, chord, thickness = (np.interp(y, self._y, column) for column in self._sections.T)
        nodes, weights = np.polynomial.legendre.leggauss(_GAUSS)
        part = self.s0[n] + 0.5 * (nodes + 1) * (self.s1[n] - self.s0[n])
        along = 0.5 * weights * (self.s1[n] - self.s0[n])
        shape = (len(y), _GAUSS)
        return (
            ((weight * chord)[:, None] * along).ravel(),
            (edge[:, None] + part * chord[:, None]).ravel(),
            np.broadcast_to(y[:, None], shape).ravel(),
            np.broadcast_to(thickness[:, None], shape).ravel(),
        )

    @cached_property
    def _points(self) -> tuple[Index, Array, Array]:
        """Point masses of rods (with glue), markers and lumps: body [P], mass [P] kg, position [P, 3] m."""
        masses, places = [], []
        t = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
        for rod in self.wing.rods:
            ends = np.array([[rod.x_root, rod.y_root, 0.0], [rod.x_tip, rod.y_tip, 0.0]])
            per_metre = rod.density * math.pi / 4 * rod.diameter**2 + rod.glue_linear_density
            masses.append(np.full(_SAMPLES, per_metre * float(np.linalg.norm(ends[1] - ends[0])) / _SAMPLES))
            places.append(ends[0] + t[:, None] * (ends[1] - ends[0]))
        lumps = [Lump(m.mass, m.position) for m in self.wing.markers] + list(self.lumps)
        masses.append(np.array([lump.mass for lump in lumps]))
        places.append(np.reshape([lump.place for lump in lumps], (-1, 3)))
        where = np.concatenate(places)
        return self.under(where[:, 0], where[:, 1]), np.concatenate(masses), where

    @cached_property
    def bodies(self) -> tuple[Array, Array, Array]:
        """Mass [N] kg, centre of mass [N, 3] m and inertia about it [N, 3, 3] kg m^2 of each body, wing frame."""
        found = [self._body(n) for n in range(len(self.strip))]
        mass, centre, inertia = (np.array([f[k] for f in found]) for k in range(3))
        if self.aft:
            area = np.add.reduceat(self.area, self.start[:-1])
            chord = area / np.diff(self.edges)
            centre[:, 0] += self.aft * (chord * (self.edges[-1] - self.edges[0]) / area.sum())[self.strip]
        return mass, centre, inertia

    def _body(self, n: int) -> tuple[float, Array, Array]:
        materials = self.wing.materials
        area, x, y, h = self._plan(n)
        foam, skin = materials.foam_density * h * area, materials.skin_areal_density * area
        carrier, masses, places = self._points
        mine = carrier == n
        m = np.concatenate([foam + skin, masses[mine]])
        r = np.concatenate([np.stack([x, y, np.zeros_like(x)], axis=1), places[mine]])
        centre = m @ r / m.sum()
        r = r - centre
        through = float((foam * h**2 / 12 + skin * h**2 / 4).sum())  # foam fills the thickness, skin lies on both faces
        inertia = np.einsum("p,pk,pk->", m, r, r) * np.eye(3) - np.einsum("p,pi,pj->ij", m, r, r)
        return float(m.sum()), centre, inertia + np.diag([through, through, 0.0])
