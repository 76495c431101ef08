"""A rigid body that no torque acts on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.integrate import cumulative_simpson
from scipy.special import ellipj, ellipk

Array = npt.NDArray[np.float64]


class FreeBody:
    """Torque-free asymmetric body (Landau and Lifshitz, Mechanics, section 37), rates about its principal axes."""

    def __init__(self, inertia: Array, spin: Array) -> None:
        i1, i2, i3 = inertia
        self.inertia, self.energy2 = inertia, float(inertia @ spin**2)
        self.momentum = float(np.linalg.norm(inertia * spin))
        e, m2 = self.energy2, self.momentum**2
        assert m2 > e * i2, "the closed form below is for motion around the third axis"
        self.sizes = np.sqrt(
            [(e * i3 - m2) / (i1 * (i3 - i1)), (e * i3 - m2) / (i2 * (i3 - i2)), (m2 - e * i1) / (i3 * (i3 - i1))]
        )
        self.pace = np.sqrt((i3 - i2) * (m2 - e * i1) / (i1 * i2 * i3))
        self.m = (i2 - i1) * (e * i3 - m2) / ((i3 - i2) * (m2 - e * i1))
        self.period = 4 * ellipk(self.m) / self.pace

    def rates(self, t: Array) -> Array:
        """omega [T, 3] at times ``t``, omega_2 = 0 at 0 (Eqs. 37.8-37.12)."""
        sn, cn, dn, _ = ellipj(self.pace * t, self.m)
        return np.stack([cn, sn, dn], axis=1) * self.sizes

    def precession(self, t: Array) -> Array:
        """Angle of the third axis about the angular momentum since t[0] (Eq. 37.17), ``t`` finely spaced."""
        across = self.inertia[:2] * self.rates(t)[:, :2] ** 2
        rate = self.momentum * across.sum(axis=1) / (across @ self.inertia[:2])
        return np.asarray(cumulative_simpson(rate, x=t, initial=0.0))
