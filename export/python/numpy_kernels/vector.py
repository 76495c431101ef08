"""In place of :mod:`wingfit.sim.kernels.lanes.vector`: lanes are the last axis of numpy arrays, of any length.

Where an array has no axis for the lanes of its own, groups of STATION_LANES neighbours of its last axis are loaded.
"""

from __future__ import annotations

from typing import Any

import numpy as np

STATION_LANES = 8  # stations along a wing


class Vector(np.ndarray[Any, np.dtype[np.float64]]):
    """Lanes as a value: ``x += y`` makes a new vector, as in compiled code, and changes no other name of the old."""

    def __iadd__(self, other: Any) -> Any:  # type: ignore[misc]
        return self + other

    def __isub__(self, other: Any) -> Any:  # type: ignore[misc]
        return self - other

    def __imul__(self, other: Any) -> Any:  # type: ignore[misc]
        return self * other


def _lanes(array: Any, *place: int) -> Any:
    """Return the index of the lanes at ``place`` in ``array``."""
    if array.ndim > len(place):
        return place
    *outer, last = place
    return (*outer, slice(STATION_LANES * last, STATION_LANES * (last + 1)))


def load(array: Any, *place: int) -> Any:
    """Return the lanes of ``array`` at ``place`` as a vector."""
    return array[_lanes(array, *place)].copy().view(Vector)


def store(array: Any, *place_and_value: Any) -> None:
    """Set the lanes of ``array`` at a place, the indices before the last argument, to the last argument."""
    *place, value = place_and_value
    array[_lanes(array, *place) if place else slice(None)] = value


def load0(array: Any) -> Any:
    """Return all of ``array`` as a vector."""
    return array.copy().view(Vector)


load1 = load3 = load
store0 = store1 = store3 = store


def root(x: Any) -> Any:
    """Return the square roots."""
    return np.sqrt(x)


def magnitude(x: Any) -> Any:
    """Return the absolute values."""
    return np.abs(x)


def least(x: Any, limit: float) -> Any:
    """Return ``x``, at most ``limit``."""
    return np.minimum(x, limit)


def greatest(x: Any, limit: float) -> Any:
    """Return ``x``, at least ``limit``."""
    return np.maximum(x, limit)
