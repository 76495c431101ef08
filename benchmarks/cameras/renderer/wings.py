"""An analytic flapping wing: a rigid flap, a twist and a bending, with markers as on the Robird."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.cameras.renderer.scene import Glare, Poses, Scene, Surface, frames_of, grid_triangles
from wingfit.records.array_types import Array

_STEP = 1e-4  # m, of the differences that give the tangents
ROWS = COLUMNS = 7  # of markers: along the span and along the chord


@dataclass(frozen=True)
class Flapping:
    """A wing whose root lies along x (chord, from the leading edge), with y along the span and z up.

    The point (x, y) of its plan is turned by the twist about the axis x = ``axis``, raised by the bending, and turned
    by the flap about the axis of x: twist * (y / span) * cos(w t + twist_phase), bending * (y / span)^2 *
    cos(w t + bend_phase), bias + flap * cos(w t), with w = 2 pi frequency.

    Attributes:
        frequency: Hz.
        span: m; ``root`` and ``tip``: chords there, m; ``sweep``: x of the tip's leading edge, m.
        flap, bias, twist: angles, rad; ``bending``: of the tip, m; ``axis``: m.
        twist_phase, bend_phase: rad.
        hinge: displacement [3] of the axis of the flap, m.
    """

    frequency: float = 3.0
    span: float = 0.5
    root: float = 0.20
    tip: float = 0.11
    sweep: float = 0.08
    flap: float = 0.5
    bias: float = 0.05
    twist: float = 0.25
    bending: float = 0.03
    axis: float = 0.06
    twist_phase: float = 1.57
    bend_phase: float = -1.0
    hinge: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def chord(self, y: Array) -> tuple[Array, Array]:
        """Leading edge (x) and chord at the stations ``y``, m."""
        s = y / self.span
        return self.sweep * s**2, self.root + (self.tip - self.root) * s

    def moved(self, times: Array, plan: Array) -> Array:
        """Positions [T, N, 3] of the points ``plan`` [N, 2] at ``times`` [T], m."""
        w = 2 * np.pi * self.frequency * times[:, None]
        x, y = plan[:, 0] - self.axis, plan[:, 1]
        s = y / self.span
        twist = self.twist * s * np.cos(w + self.twist_phase)
        flap = self.bias + self.flap * np.cos(w)
        across, up = x * np.cos(twist), -x * np.sin(twist) + self.bending * s**2 * np.cos(w + self.bend_phase)
        place = np.stack(
            [self.axis + across, y * np.cos(flap) - up * np.sin(flap), y * np.sin(flap) + up * np.cos(flap)], axis=-1
        )
        return np.asarray(place + np.array(self.hinge))

    def poses(self, times: Array, plan: Array) -> Poses:
        """Poses of markers at the points ``plan`` [K, 2] on the upper side."""
        dx, dy = np.array([_STEP, 0.0]), np.array([0.0, _STEP])
        along = self.moved(times, plan + dx) - self.moved(times, plan - dx)
        across = self.moved(times, plan + dy) - self.moved(times, plan - dy)
        return Poses(self.moved(times, plan), frames_of(along, across))

    def markers(self) -> Array:
        """Plan [49, 2] of seven rows of seven markers, denser towards the tip and the trailing edge, m."""
        u = 0.06 + 0.90 * np.arange(ROWS) / (ROWS - 1)
        y = self.span * (1 - (1 - u) ** 1.25)
        u = 0.05 + 0.88 * np.arange(COLUMNS) / (COLUMNS - 1)
        lead, chord = self.chord(y)
        x = lead[:, None] + chord[:, None] * (1 - (1 - u) ** 1.15)
        return np.stack([x.ravel(), np.repeat(y, COLUMNS)], axis=1)

    def mesh(self, rows: int = 12, columns: int = 8) -> Array:
        """Plan [rows * columns, 2] of a grid over the whole wing, m."""
        y = np.linspace(0.01, self.span, rows)
        lead, chord = self.chord(y)
        x = lead[:, None] + chord[:, None] * np.linspace(0, 1, columns)
        return np.stack([x.ravel(), np.repeat(y, columns)], axis=1)


def analytic_scene(wing: Flapping, size: float = 0.010) -> Scene:
    """Scene of ``wing`` with 49 chequers of width ``size`` (m), its dark surface, and a wandering highlight."""
    plan, mesh = wing.markers(), wing.mesh()
    names = tuple(f"m{k:02d}" for k in range(1, len(plan) + 1))

    def highlight(times: Array) -> Array:
        """It wanders along the span as the wing turns."""
        y = wing.span * (0.45 + 0.35 * np.cos(2 * np.pi * wing.frequency * times + 0.7))
        lead, chord = wing.chord(y)
        points = np.stack([lead + 0.55 * chord, y], axis=1)
        return np.stack([wing.moved(times[t : t + 1], points[t : t + 1])[0, 0] for t in range(len(times))])

    return Scene(
        lambda times: wing.poses(times, plan),
        names,
        np.full(len(plan), size),
        surface=Surface(lambda times: wing.moved(times, mesh), grid_triangles(12, 8)),
        glares=(Glare(0.5, 6.0, highlight),),
    )
