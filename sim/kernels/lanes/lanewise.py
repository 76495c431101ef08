"""Functions for which processors have no vector instruction; each lane of the vector is computed separately."""

from __future__ import annotations

import math

import numpy as np

from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.jit import allocating
from wingfit.sim.kernels.lanes.vector import Vector, load1, store1


@allocating
def angle(y: Vector, x: Vector) -> Vector:
    """Return atan2(y, x) in rad."""
    scratch = np.empty((2, LANES))
    store1(scratch, 0, y)
    store1(scratch, 1, x)
    for w in range(LANES):
        scratch[0, w] = math.atan2(scratch[0, w], scratch[1, w])
    return load1(scratch, 0)


@allocating
def cosine_and_sine(x: Vector) -> tuple[Vector, Vector]:
    """Return the cosine and the sine of ``x`` (rad)."""
    scratch = np.empty((2, LANES))
    store1(scratch, 0, x)
    for w in range(LANES):
        value = scratch[0, w]
        scratch[0, w], scratch[1, w] = math.cos(value), math.sin(value)
    return load1(scratch, 0), load1(scratch, 1)


@allocating
def exponential(x: Vector) -> Vector:
    """Return e to the power of ``x``."""
    scratch = np.empty((1, LANES))
    store1(scratch, 0, x)
    for w in range(LANES):
        scratch[0, w] = math.exp(scratch[0, w])
    return load1(scratch, 0)


@allocating
def power(x: Vector, exponent: Vector) -> Vector:
    """Return ``x`` to the power of ``exponent``, for x >= 0."""
    scratch = np.empty((2, LANES))
    store1(scratch, 0, x)
    store1(scratch, 1, exponent)
    for w in range(LANES):
        scratch[0, w] = math.pow(scratch[0, w], scratch[1, w])
    return load1(scratch, 0)
