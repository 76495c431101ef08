"""How kernels are compiled: cached on disk, fused multiply-add allowed, no other liberty with the arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import llvmlite.binding as llvm
import numba

F = TypeVar("F", bound=Callable[..., object])

# The lane loops read and write a dozen arrays; LLVM's default of 8 run-time alias checks would leave them scalar.
llvm.set_option("", "-runtime-memory-check-threshold=512")
llvm.set_option("", "-memory-check-merge-threshold=512")


def kernel(function: F) -> F:
    """Compile a loop over lanes, cached on disk."""
    return cast(F, numba.njit(cache=True, fastmath={"contract"}, error_model="numpy", nogil=True)(function))


def inline(function: F) -> F:
    """Compile scalar algebra that is inlined into lane loops."""
    return cast(F, numba.njit(inline="always", fastmath={"contract"}, error_model="numpy")(function))
