"""Operations on vectors in space, given as tuples of three floats, for compiled code."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled

Array = npt.NDArray[np.float64]
V3 = tuple[float, float, float]
ZERO = (0.0, 0.0, 0.0)


@compiled
def row(x: Array, i: int) -> V3:
    """Row ``i`` of the array ``x`` [n, 3] as a vector."""
    return x[i, 0], x[i, 1], x[i, 2]


@compiled
def axis(R: Array, n: int, k: int) -> V3:
    """Axis ``k`` of frame ``n`` in world axes: column k of the rotation matrix R[n]."""
    return R[n, 0, k], R[n, 1, k], R[n, 2, k]


@compiled
def cross(x: V3, y: V3) -> V3:
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@compiled
def dot(x: V3, y: V3) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@compiled
def plus(x: V3, f: float, y: V3) -> V3:
    """The vector x + f y."""
    return x[0] + f * y[0], x[1] + f * y[1], x[2] + f * y[2]


@compiled
def turned(R: Array, n: int, x: V3) -> V3:
    """R[n] x: the vector ``x`` of frame ``n`` in world axes."""
    return (
        R[n, 0, 0] * x[0] + R[n, 0, 1] * x[1] + R[n, 0, 2] * x[2],
        R[n, 1, 0] * x[0] + R[n, 1, 1] * x[1] + R[n, 1, 2] * x[2],
        R[n, 2, 0] * x[0] + R[n, 2, 1] * x[1] + R[n, 2, 2] * x[2],
    )


@compiled
def act(load: Array, n: int, force: V3, moment: V3) -> None:
    """Add a force and a moment to the load on body ``n``, row n of ``load`` [., 6]."""
    for i in range(3):
        load[n, i] += force[i]
        load[n, 3 + i] += moment[i]


@compiled
def turn_by(g: V3, R0: Array, n: int, R: Array) -> None:
    """Set R[n] = C(g) R0[n], where C(g) is the rotation of the quaternion (1, g / 2) (Cayley's map)."""
    x, y, z = 0.5 * g[0], 0.5 * g[1], 0.5 * g[2]
    f = 2.0 / (1.0 + x * x + y * y + z * z)
    for k in range(3):
        a = (R0[n, 0, k], R0[n, 1, k], R0[n, 2, k])
        t = plus(cross((x, y, z), a), 1.0, cross((x, y, z), cross((x, y, z), a)))
        for i in range(3):
            R[n, i, k] = a[i] + f * t[i]
