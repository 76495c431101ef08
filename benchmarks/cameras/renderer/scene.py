"""What is filmed: markers that move, the dark surface that carries them, rods in front of it, and glare."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from benchmarks.cameras.renderer.kernels import BALL, CHEQUER, DOT
from wingfit.records.array_types import Array, Index

Motion = Callable[[Array], Array]
Kind = Literal["chequer", "dot", "ball"]
KINDS: dict[Kind, int] = {"chequer": CHEQUER, "dot": DOT, "ball": BALL}


class Poses(NamedTuple):
    """Markers at T instants: ``positions`` [T, K, 3] (m) and ``axes`` [T, K, 3, 3].

    Rows of ``axes`` are two orthonormal tangents, along the edges of a chequer, and the normal to the reflecting side.
    """

    positions: Array
    axes: Array


@dataclass(frozen=True)
class Surface:
    """A dark surface that hides what is behind it.

    Attributes:
        vertices: maps instants [T] to positions [T, V, 3], m.
        triangles: indices of vertices [M, 3].
        albedo: light that it reflects, relative to a marker.
        margin: a marker is hidden only if it is farther than this behind the surface, m; those on it are not.
    """

    vertices: Motion
    triangles: Index
    albedo: float = 0.02
    margin: float = 0.006


@dataclass(frozen=True)
class Rod:
    """A rod with round ends that hides what is behind it.

    ``ends`` maps instants [T] to its ends [T, 2, 3], m; ``radius`` in m; ``albedo`` as in :class:`Surface`.
    """

    ends: Motion
    radius: float
    albedo: float = 0.01


@dataclass(frozen=True)
class Glare:
    """A Gaussian bright spot.

    Attributes:
        brightness: of its centre, relative to a marker.
        blur: standard deviation, pixels.
        path: maps instants [T] to positions [T, 3] in the world (m), or None.
        pixel: its place in the images instead, for reflections within the lens.
    """

    brightness: float
    blur: float
    path: Motion | None = None
    pixel: tuple[float, float] | None = None


@dataclass(frozen=True)
class Scene:
    """A scene.

    Attributes:
        poses: maps instants [T] to :class:`Poses`.
        names: of the K markers.
        sizes: widths of the markers, or diameters of dots and balls, [K] m.
        kind: of all markers. A chequer is 2 by 2 squares, of which the two on the diagonal between the tangents
            reflect; a dot is a disc, a ball is round from all sides.
        surface: that carries the markers, or None.
        rods: that hide markers.
        glares: bright spots.
        retro: exponent p of the brightness of a marker that is seen at the angle a from its normal, cos(a)^p.
    """

    poses: Callable[[Array], Poses]
    names: tuple[str, ...]
    sizes: Array
    kind: Kind = "chequer"
    surface: Surface | None = None
    rods: tuple[Rod, ...] = ()
    glares: tuple[Glare, ...] = ()
    retro: float = 1.5

    def vertices(self, times: Array) -> Array:
        """Corners of the surface's triangles [T, M, 3, 3] at ``times`` [T], m."""
        if self.surface is None:
            return np.zeros((len(times), 0, 3, 3))
        return np.asarray(self.surface.vertices(times)[:, self.surface.triangles])

    def rod_ends(self, times: Array) -> Array:
        """Ends of the rods [T, C, 2, 3] at ``times`` [T], m."""
        if not self.rods:
            return np.zeros((len(times), 0, 2, 3))
        return np.stack([rod.ends(times) for rod in self.rods], axis=1)

    @property
    def radii(self) -> Array:
        """Radii of the rods [C], m."""
        return np.array([rod.radius for rod in self.rods])


def frames_of(along: Array, across: Array) -> Array:
    """Orthonormal axes [..., 3, 3] from two tangents [..., 3]: the first stays, the normal is along x across."""
    first = along / np.linalg.norm(along, axis=-1, keepdims=True)
    normal = np.cross(first, across)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([first, np.cross(normal, first), normal], axis=-2)


def grid_triangles(rows: int, columns: int) -> Index:
    """Triangles [2 (rows - 1) (columns - 1), 3] of a grid of vertices that is stored row by row."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    one = np.stack([corner, corner + 1, corner + columns], axis=1)
    other = np.stack([corner + 1, corner + columns + 1, corner + columns], axis=1)
    return np.concatenate([one, other])
