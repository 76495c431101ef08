"""In place of :mod:`wingfit.sim.kernels.jit`: functions stay as they are written."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Return ``function``, which is not compiled here."""
    return function


allocating = inlined = kernel
