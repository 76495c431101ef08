"""Lift of a thin airfoil in unsteady potential flow."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import hankel2


def theodorsen(k: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
    """C(k) [n] at reduced frequencies ``k`` [n]: H1 / (H1 + i H0), Hankel functions of the second kind.

    Theodorsen (1935, NACA Report 496), Eq. XIII.
    """
    return np.asarray(hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k)))
