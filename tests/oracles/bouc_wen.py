"""The Bouc-Wen law of hysteresis, integrated by an adaptive Runge-Kutta method."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

Array = npt.NDArray[np.float64]


def hysteretic_angle(phi: Array, beta: float, gamma: float, n: float) -> Array:
    """z [T] (rad) along a path of angles ``phi`` [T] (rad): dz/dphi = 1 - |z|^n (gamma + beta sgn(dphi z))."""
    z, path = 0.0, [0.0]
    for start, end in pairwise(phi):
        side = np.sign(end - start)

        def rate(_: float, y: Array, side: float = side) -> Array:
            return side * (1 - np.abs(y) ** n * (gamma + beta * side * np.sign(y)))

        z = float(solve_ivp(rate, (0, abs(end - start)), [z], rtol=1e-9, atol=1e-12).y[0, -1])
        path.append(z)
    return np.array(path)
