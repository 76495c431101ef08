"""How kernels are compiled: cached on disk, fused multiply-add allowed, no other liberty with the arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Compile a function over groups of lanes, cached on disk."""
    return cast(F, numba.njit(cache=True, fastmath={"contract"}, error_model="numpy", nogil=True)(function))


def inlined(function: F) -> F:
    """Compile a small function into each kernel that calls it."""
    return cast(F, numba.njit(forceinline=True, fastmath={"contract"}, error_model="numpy")(function))
