"""A polygon cut at each of its corners into slabs in which all its edges are straight and none ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wingfit.records.array_types import Array, Float

_SAME = 1e-9  # difference of coordinates below which they are the same, in extents of the polygon


@dataclass(frozen=True, eq=False)
class Slab:
    """The part of a polygon between the heights ``low`` and ``high``: edges at ``at_low`` [K] and ``at_high`` [K].

    The edges are sorted by where they are half way up; the inside lies between the first and second, third and fourth.
    """

    low: float
    high: float
    at_low: Float[Array, " K"]
    at_high: Float[Array, " K"]

    @property
    def gap(self) -> float:
        """Return the area between the outermost edges that lies outside the polygon."""
        middle = 0.5 * (self.at_low + self.at_high)
        return float((self.high - self.low) * np.sum(middle[2::2] - middle[1:-1:2]))


def slabs(points: Float[Array, "N 2"]) -> Iterator[Slab]:
    """Yield the slabs of the closed polygon with the corners ``points`` (x, y), upwards along y."""
    start, end = points, np.roll(points, -1, axis=0)
    size = _SAME * float(np.ptp(points, axis=0).max())
    heights = np.unique(points[:, 1])
    heights = heights[np.concatenate([[True], np.diff(heights) > size])]
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (end[:, 0] - start[:, 0]) / (end[:, 1] - start[:, 1])
    for bottom, top in pairwise(heights.tolist()):
        middle = 0.5 * (bottom + top)
        inside = (low < middle) & (high > middle)
        x, y, k = start[inside, 0], start[inside, 1], slope[inside]
        order = np.argsort(x + k * (middle - y))
        yield Slab(bottom, top, (x + k * (bottom - y))[order], (x + k * (top - y))[order])


def crossing(points: Float[Array, "N 2"]) -> tuple[float, float] | None:
    """Return a place (x, y) where the closed polygon ``points`` crosses itself; None if it does not."""
    size = float(np.ptp(points, axis=0).max()) * 10 * _SAME
    for slab in slabs(points):
        low, high = np.diff(slab.at_low), np.diff(slab.at_high)  # distances of neighbours; below 0 beyond a crossing
        back = np.flatnonzero(np.minimum(low, high) < -size)
        if len(back):
            k = back[0]
            part = low[k] / (low[k] - high[k])
            x = slab.at_low[k] + part * (slab.at_high[k] - slab.at_low[k])
            return float(x), float(slab.low + part * (slab.high - slab.low))
    return _crossed_level(points, size)


def _crossed_level(points: Float[Array, "N 2"], size: float) -> tuple[float, float] | None:
    """Return where an edge along x is crossed by another one; slabs do not contain edges along x."""
    start, end = points, np.roll(points, -1, axis=0)
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    for a, b in zip(start[high - low <= size], end[high - low <= size], strict=True):
        through = (low < a[1] - size) & (high > a[1] + size)
        part = (a[1] - start[through, 1]) / (end[through, 1] - start[through, 1])
        x = start[through, 0] + part * (end[through, 0] - start[through, 0])
        inside = (x > min(a[0], b[0]) + size) & (x < max(a[0], b[0]) - size)
        if inside.any():
            return float(x[inside][0]), float(a[1])
    return None
