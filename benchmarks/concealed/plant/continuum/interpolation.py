"""Interpolation of motion within an element, and its strains.

Rotations are interpolated relative to the frame of the element's middle node, so that strains do not depend on a
rotation of the whole (Crisfield and Jelenic, Proc. R. Soc. A 455, 1125 (1999)); the relative rotations are represented
by Rodrigues' vectors g, with the rotation matrix I + (g^ + g^ g^ / 2) / (1 + g.g / 4). Velocities and accelerations,
like virtual displacements and virtual rotations, are interpolated by the shape functions themselves (Simo and Vu-Quoc,
Comput. Methods Appl. Mech. Eng. 58, 79 (1986)).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.continuum.beam import Index, Motion
from benchmarks.concealed.plant.wing.vectors import V3, ZERO, axis, cross, dot, plus, row, turned

Array = npt.NDArray[np.float64]
Frame = tuple[V3, V3, V3]  # its axes x, y, z in world axes


@compiled
def blend(x: Array, e: int, part: Array, q: int) -> V3:
    """Value at point ``q`` of element ``e`` of the field with the nodal values ``x`` [n, 3]; ``part`` [., NODES]."""
    n = 2 * e
    total = plus(plus(ZERO, part[q, 0], row(x, n)), part[q, 1], row(x, n + 1))
    return plus(total, part[q, 2], row(x, n + 2))


@compiled
def spread(load: Array, e: int, part: Array, q: int, force: V3, moment: V3) -> None:
    """Add to ``load`` [n, 6] a force (N) and moment (N m) that act at point ``q`` of element ``e``."""
    for i in range(3):
        for k in range(3):
            load[2 * e + i, k] += part[q, i] * force[k]
            load[2 * e + i, 3 + k] += part[q, i] * moment[k]


@compiled
def relate(m: Motion) -> None:
    """Set ``m.turn`` from the nodes' frames ``m.R``."""
    for k in range(len(m.turn)):
        middle, end = 2 * (k // 2) + 1, 2 * (k // 2) + 2 * (k % 2)
        trace, turn = 1.0, ZERO
        for j in range(3):
            a, b = axis(m.R, middle, j), axis(m.R, end, j)
            trace += dot(a, b)
            turn = plus(turn, 1.0, cross(a, b))
        for j in range(3):
            m.turn[k, j] = 2.0 / trace * dot(turn, axis(m.R, middle, j))


@compiled
def turn_at(m: Motion, e: int, part: Array, q: int) -> V3:
    """Rodrigues' vector of the frame at point ``q`` of element ``e``, relative to the element's middle.

    With derivatives of the shape functions in place of ``part``: its derivative by y.
    """
    return plus(plus(ZERO, part[q, 0], row(m.turn, 2 * e)), part[q, 2], row(m.turn, 2 * e + 1))


@compiled
def frame_at(m: Motion, e: int, part: Array, q: int) -> Frame:
    """Frame at point ``q`` of element ``e``."""
    g, middle = turn_at(m, e, part, q), 2 * e + 1
    size = 1.0 / (1.0 + 0.25 * dot(g, g))
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return (
        turned(m.R, middle, _rotated(g, size, x)),
        turned(m.R, middle, _rotated(g, size, y)),
        turned(m.R, middle, _rotated(g, size, z)),
    )


@compiled
def _rotated(g: V3, size: float, x: V3) -> V3:
    once = cross(g, x)
    return plus(plus(x, size, once), 0.5 * size, cross(g, once))


@compiled
def outward(frame: Frame, x: V3) -> V3:
    """The vector ``x`` of ``frame`` in world axes."""
    return plus(plus(plus(ZERO, x[0], frame[0]), x[1], frame[1]), x[2], frame[2])


@compiled
def inward(frame: Frame, x: V3) -> V3:
    """The vector ``x`` of the world in the axes of ``frame``."""
    return dot(frame[0], x), dot(frame[1], x), dot(frame[2], x)


@compiled
def curvature_at(m: Motion, e: int, part: Array, slope: Array, q: int) -> V3:
    """Curvature and twist K = axial(R^T R') at point ``q`` of element ``e``, 1/m, in the section's frame.

    For Rodrigues' vector g: (g' - g x g' / 2) / (1 + g.g / 4).
    """
    g, rate = turn_at(m, e, part, q), turn_at(m, e, slope, q)
    return plus(ZERO, 1.0 / (1.0 + 0.25 * dot(g, g)), plus(rate, -0.5, cross(g, rate)))


@compiled
def trace_points(R: Array, p: Array, element: Index, part: Array, arm: Array, m: Motion, out: Array) -> None:
    """Set ``out`` [n, M, 3] to the places of points at ``arm`` [M, 3] (m) from their sections on the reference line.

    ``R`` [n, nodes, 3, 3], ``p`` [n, nodes, 3]: motion of the nodes; ``element`` [M] and ``part`` [M, NODES] of each
    point; ``m``: overwritten.
    """
    for t in range(len(p)):
        m.R[:], m.p[:] = R[t], p[t]
        relate(m)
        for k in range(len(element)):
            e = element[k]
            there = plus(blend(m.p, e, part, k), 1.0, outward(frame_at(m, e, part, k), row(arm, k)))
            for i in range(3):
                out[t, k, i] = there[i]
