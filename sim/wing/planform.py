"""Geometry and mass properties of the wing and of its panels, the pieces that are simulated as rigid bodies.

In the wing frame, x points aft along the chord, y along the span from root to tip, z normal to the wing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records import Marker, Wing
from wingfit.records.array_types import Array, ArrayLike, Index
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.sections import round_area

_CELLS = 24  # quadrature cells along each side of a panel: mass and inertia to about 1e-4
_ROD_CELLS = 2000


@dataclass(frozen=True)
class Panel:
    """Piece of the wing between the span positions ``y0``, ``y1`` (m) and the fractions ``s0``, ``s1`` of the chord."""

    y0: float
    y1: float
    s0: float
    s1: float


@dataclass(frozen=True)
class Body:
    """Mass properties of one rigid body, in the wing frame at rest.

    ``mass`` (kg), ``centre`` of mass [3] (m), ``inertia`` [3, 3] about it (kg m^2), ``area`` of its planform (m^2) and
    the ``centroid`` [3] of that area (m).
    """

    mass: float
    centre: Array
    inertia: Array
    area: float
    centroid: Array


class Planform:
    """Leading edge, chord and thickness of a wing, interpolated linearly between the sections where they are given."""

    def __init__(self, wing: Wing) -> None:
        self.wing = wing
        self._y = np.array([s.y for s in wing.stations])
        self._le = np.array([s.leading_edge for s in wing.stations])
        self._chord = np.array([s.chord for s in wing.stations])
        self._thickness = np.array([s.thickness for s in wing.stations])

    def leading_edge(self, y: ArrayLike) -> Array:
        """x (m) of the leading edge at span position ``y`` (m)."""
        return np.asarray(np.interp(np.asarray(y, float), self._y, self._le))

    def chord(self, y: ArrayLike) -> Array:
        """Chord (m) at span position ``y`` (m)."""
        return np.asarray(np.interp(np.asarray(y, float), self._y, self._chord))

    def thickness(self, y: ArrayLike) -> Array:
        """Thickness (m) at span position ``y`` (m)."""
        return np.asarray(np.interp(np.asarray(y, float), self._y, self._thickness))

    def x(self, fraction: float, y: float) -> float:
        """x (m) at a ``fraction`` of the chord behind the leading edge, at span position ``y`` (m)."""
        return float(self.leading_edge(y) + fraction * self.chord(y))

    def fraction(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Fraction of the chord (0 leading edge, 1 trailing edge) at points ``x``, ``y`` (m), clipped to [0, 1]."""
        return np.asarray(np.clip((np.asarray(x, float) - self.leading_edge(y)) / self.chord(y), 0.0, 1.0))

    def panels(self, division: Division) -> list[Panel]:
        """Divide the planform into panels, in the order of the bodies: root to tip, then leading to trailing edge.

        Strips along the span have equal widths; panels of a strip have equal chords.
        """
        edges = np.linspace(self._y[0], self._y[-1], len(division.bodies) + 1)
        return [
            Panel(float(edges[i]), float(edges[i + 1]), k / n, (k + 1) / n)
            for i, n in enumerate(division.bodies)
            for k in range(n)
        ]

    def strips(self, division: Division) -> Array:
        """Span positions [S + 1] (m) of the edges of the S strips, from root to tip."""
        return np.linspace(self._y[0], self._y[-1], len(division.bodies) + 1)


def carriers(panels: Sequence[Panel], y: Array, fraction: Array) -> Index:
    """Indices [N] of the ``panels`` that contain N points; on an edge between panels, of the outer or rear one.

    ``y`` [N]: span positions of the points, m; ``fraction`` [N]: their fractions of the chord.
    """
    edges = np.unique([panel.y0 for panel in panels])
    strip = np.clip(np.searchsorted(edges, y, side="right") - 1, 0, len(edges) - 1)
    first = np.searchsorted([panel.y0 for panel in panels], edges)
    count = np.diff(np.append(first, len(panels)))[strip]
    return np.asarray(first[strip] + np.minimum((fraction * count).astype(np.int64), count - 1), np.int64)


@one_blas_thread
def bodies(planform: Planform, panels: list[Panel]) -> list[Body]:
    """Compute the mass properties of every panel.

    Foam and skin are integrated over the panel; rods (with the glue of their straws) and markers are added as point
    masses.
    """
    lumps: list[list[tuple[float, Array]]] = [[] for _ in panels]
    for rod in planform.wing.rods:
        linear = rod.density * round_area(rod.diameter) + rod.glue_linear_density
        length = math.hypot(rod.x_tip - rod.x_root, rod.y_tip - rod.y_root)
        t = (np.arange(_ROD_CELLS) + 0.5) / _ROD_CELLS
        x, y = rod.x_root + t * (rod.x_tip - rod.x_root), rod.y_root + t * (rod.y_tip - rod.y_root)
        for number, *place in zip(carriers(panels, y, planform.fraction(x, y)), x, y, strict=True):
            lumps[number].append((linear * length / _ROD_CELLS, np.array([*place, 0.0])))
    markers = planform.wing.markers
    for marker, number in zip(markers, marker_carriers(planform, panels, markers), strict=True):
        lumps[number].append((marker.mass, np.array(marker.position)))
    return [_body(planform, panel, extra) for panel, extra in zip(panels, lumps, strict=True)]


def wing_mass(wing: Wing) -> float:
    """Mass of a wing (kg), rods and markers included."""
    planform = Planform(wing)
    return sum(body.mass for body in bodies(planform, planform.panels(Division((4, 4, 4, 4)))))


def _body(planform: Planform, panel: Panel, lumps: list[tuple[float, Array]]) -> Body:
    materials = planform.wing.materials
    y = panel.y0 + (np.arange(_CELLS) + 0.5) / _CELLS * (panel.y1 - panel.y0)
    s = panel.s0 + (np.arange(_CELLS) + 0.5) / _CELLS * (panel.s1 - panel.s0)
    chord, thickness = planform.chord(y), planform.thickness(y)
    cell = np.repeat(chord * (panel.s1 - panel.s0) / _CELLS * (panel.y1 - panel.y0) / _CELLS, _CELLS)
    points = np.zeros((_CELLS * _CELLS, 3))
    points[:, 0] = (planform.leading_edge(y)[:, None] + s * chord[:, None]).ravel()
    points[:, 1] = np.repeat(y, _CELLS)
    h = np.repeat(thickness, _CELLS)
    foam, skin = materials.foam_density * h * cell, materials.skin_areal_density * cell
    masses = np.concatenate([foam + skin, [mass for mass, _ in lumps]])
    places = np.concatenate([points, np.reshape([place for _, place in lumps], (-1, 3))])
    total = float(masses.sum())
    centre = masses @ places / total
    r = places - centre
    inertia = np.eye(3) * (masses @ (r**2).sum(axis=1)) - (r * masses[:, None]).T @ r
    # thickness: foam through it, skin half on each face
    through = float((foam * h**2 / 12 + skin * h**2 / 4).sum())
    # the cells' own moments of inertia in the plane
    deep, wide = np.repeat(chord, _CELLS) * (panel.s1 - panel.s0) / _CELLS, (panel.y1 - panel.y0) / _CELLS
    along_x, along_y = float((foam + skin) @ deep**2) / 12, float((foam + skin).sum()) * wide**2 / 12
    inertia += np.diag([through + along_y, through + along_x, along_x + along_y])
    area = float(cell.sum())
    return Body(total, centre, inertia, area, cell @ points / area)


def marker_carriers(planform: Planform, panels: list[Panel], markers: tuple[Marker, ...]) -> Index:
    """Indices [M] of the bodies on which the M ``markers`` lie."""
    x, y, _ = np.array([marker.position for marker in markers]).T
    return carriers(panels, y, planform.fraction(x, y))
