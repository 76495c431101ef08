"""Convert one individual's state to coordinates relative to a pose, and back, to search for a periodic motion."""

from __future__ import annotations

import math

from wingfit.records.array_types import Array
from wingfit.sim.kernels.arrays import State
from wingfit.sim.kernels.jit import inlined, kernel

LENGTH = 0.1  # m, about a chord; converts rotations to displacements


@kernel
def coordinates(about: State, state: State, rate: float, sizes: Array, out: Array) -> None:
    """Fill ``out`` [12 N + Z] with coordinates (m) of ``state`` relative to the pose of the state ``about``.

    N bodies without the driving rods, Z states of effects. For each body: rotation vector times LENGTH, displacement,
    angular velocity times LENGTH over ``rate`` (rad/s, of the beat), velocity over ``rate``; then the effects' states
    times ``sizes`` [Z]. Both states are those of one individual: their arrays have no axis of individuals.
    """
    bodies = len(state.V) - 2
    for n in range(bodies):
        k = 12 * n
        x, y, z = rotation_vector(about.R[n], state.R[n])
        out[k], out[k + 1], out[k + 2] = LENGTH * x, LENGTH * y, LENGTH * z
        for i in range(3):
            out[k + 3 + i] = state.p[n, i] - about.p[n, i]
            out[k + 6 + i] = state.V[n, i] / rate * LENGTH
            out[k + 9 + i] = state.V[n, 3 + i] / rate
    for i in range(len(sizes)):
        out[12 * bodies + i] = state.z[i] * sizes[i]


@kernel
def displaced(about: State, x: Array, rate: float, sizes: Array, state: State) -> None:
    """Set ``state`` from its coordinates ``x`` [12 N + Z], the inverse of :func:`coordinates`; its rods stay."""
    bodies = len(state.V) - 2
    for n in range(bodies):
        k = 12 * n
        turn(about.R[n], x[k] / LENGTH, x[k + 1] / LENGTH, x[k + 2] / LENGTH, state.R[n])
        for i in range(3):
            state.p[n, i] = about.p[n, i] + x[k + 3 + i]
            state.V[n, i] = x[k + 6 + i] / LENGTH * rate
            state.V[n, 3 + i] = x[k + 9 + i] * rate
    for i in range(len(sizes)):
        state.z[i] = x[12 * bodies + i] / sizes[i]


@inlined
def rotation_vector(first: Array, second: Array) -> tuple[float, float, float]:
    """Return the rotation vector (rad) of first^T second, for two rotation matrices [9], by the unit quaternion.

    The quaternion's largest component is computed first and the others from it, for accuracy at any angle (Shepperd, J.
    Guidance and Control 1, 1978).
    """
    a, b, c = _column(first, second, 0)
    d, e, f = _column(first, second, 1)
    g, h, i = _column(first, second, 2)
    trace = a + e + i
    if trace >= max(a, e, i):
        w, x, y, z = 1 + trace, f - h, g - c, b - d
    elif a >= e and a >= i:
        w, x, y, z = f - h, 1 + a - e - i, b + d, c + g
    elif e >= i:
        w, x, y, z = g - c, b + d, 1 + e - i - a, f + h
    else:
        w, x, y, z = b - d, c + g, f + h, 1 + i - a - e
    sine = math.sqrt(x * x + y * y + z * z)  # of half the angle, with the same factor as w
    factor = 2 * math.atan(sine / w) / sine if sine != 0 else 0.0
    return factor * x, factor * y, factor * z


@inlined
def _column(first: Array, second: Array, k: int) -> tuple[float, float, float]:
    """Return column ``k`` of first^T second, for matrices [9] row by row."""
    u, v, w = second[k], second[3 + k], second[6 + k]
    return (
        first[0] * u + first[3] * v + first[6] * w,
        first[1] * u + first[4] * v + first[7] * w,
        first[2] * u + first[5] * v + first[8] * w,
    )


@inlined
def turn(first: Array, x: float, y: float, z: float, out: Array) -> None:
    """Set ``out`` [9] to ``first`` [9] times the rotation by the vector (x, y, z) in rad (Rodrigues 1840)."""
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    once = math.sin(angle) / angle if angle > 0 else 1.0
    twice = 0.5 * (math.sin(half) / half) ** 2 if half > 0 else 0.5
    for i in range(3):
        p, q, r = first[3 * i], first[3 * i + 1], first[3 * i + 2]
        # a row times the matrix of the cross product, once and twice
        u, v, w = q * z - r * y, r * x - p * z, p * y - q * x
        out[3 * i] = p + once * u + twice * (v * z - w * y)
        out[3 * i + 1] = q + once * v + twice * (w * x - u * z)
        out[3 * i + 2] = r + once * w + twice * (u * y - v * x)
