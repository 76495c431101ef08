"""A pair of cameras above the wing, for faults that differ between the two images.

Pinhole cameras at equal heights look down along -z; the line between them is parallel to the span. Points are
triangulated from the two images: the distance follows from the disparity.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.effects.contract import Parameter, Values

_place = partial(Parameter, assumed=True)
PLACES = (
    _place("x", "m", -1.0, 2.0, 0.5, "x of the point that both cameras aim at, at height z = 0", "chord"),
    _place("y", "m", 0.0, 1.0, 0.5, "y of the point that both cameras aim at", "span"),
    _place("distance", "m", 2.0, 10.0, 2.5, "height of the cameras above z = 0", "span"),
    _place("base", "1", 0.1, 1.0, 0.4, "distance between the cameras over their height"),
)
"""Shape parameters of an effect that depends on the cameras; typically a metre or two away, 20 degrees apart."""


@dataclass(frozen=True)
class Stereo:
    """Two cameras for each of B individuals.

    Attributes:
        x, y: point of the plane z = 0 that both cameras aim at, m [B, 1, 1].
        distance: height of the cameras above that plane, m [B, 1, 1].
        base: distance between the cameras, m [B, 1, 1].
    """

    x: Array
    y: Array
    distance: Array
    base: Array

    @classmethod
    def of(cls, values: Values) -> Stereo:
        """Return the cameras of B individuals, from the ``values`` [B] of the parameters PLACES by name."""
        x, y, distance, base = (values[p.name][:, None, None] for p in PLACES)
        return cls(x, y, distance, base * distance)

    def image(self, points: Array, side: float) -> tuple[Array, Array]:
        """Return the image coordinates (u along x, v along y) [B, n, M] of ``points`` [B, n, M, 3] (m) in one camera.

        Coordinates are in focal lengths from the image of the point aimed at; n instants, M markers. ``side`` is -1 for
        the inner camera, nearer the root, and 1 for the outer one.
        """
        depth = self.distance - points[..., 2]
        camera = self.y + 0.5 * side * self.base
        u = (points[..., 0] - self.x) / depth
        v = (points[..., 1] - camera) / depth + 0.5 * side * self.base / self.distance
        return u, v

    def points(self, inner: tuple[Array, Array], outer: tuple[Array, Array]) -> Array:
        """Triangulate points [B, n, M, 3] (m) from their images (u, v) in the ``inner`` and ``outer`` camera.

        Depth = base / disparity (Hartley and Zisserman 2004, Multiple View Geometry; parallel cameras). Where the rays
        do not meet, the point is half-way between them.
        """
        disparity = inner[1] - outer[1] + self.base / self.distance
        depth = self.base / disparity
        x = self.x + 0.5 * (inner[0] + outer[0]) * depth
        y = self.y + 0.5 * (inner[1] + outer[1]) * depth
        return np.stack([x, y, self.distance - depth], axis=-1)
