"""Arrays in which every group of lanes fills one cache line; loading one that spans two lines takes twice as long."""

from __future__ import annotations

import math

import numpy as np

from wingfit.records.array_types import Array, ArrayLike
from wingfit.sim.kernels import LANES

_LINE = 8 * LANES


def zeros(shape: tuple[int, ...]) -> Array:
    """Return zeros of ``shape`` [..., LANES] whose first element lies at the start of a cache line."""
    count = math.prod(shape)
    whole = np.zeros(count + LANES)
    start = -whole.__array_interface__["data"][0] % _LINE // 8
    return whole[start : start + count].reshape(shape)


def aligned(array: ArrayLike) -> Array:
    """Return a copy of ``array`` [..., LANES] whose first element lies at the start of a cache line."""
    values = np.asarray(array, float)
    out = zeros(values.shape)
    out[...] = values
    return out


def several(shapes: dict[str, tuple[int, ...]]) -> dict[str, Array]:
    """Return zeros [..., LANES] by name for ``shapes`` [...], all from one allocation, since dozens are needed."""
    sizes = {name: LANES * math.prod(shape) for name, shape in shapes.items()}
    whole, start, found = zeros((sum(sizes.values()),)), 0, {}
    for name, size in sizes.items():
        found[name] = whole[start : start + size].reshape(*shapes[name], LANES)
        start += size
    return found
