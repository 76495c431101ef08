"""Description of the drive: the flap angle of the driving rods as a function of the phase of the beat."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest
from typing import Literal

import numpy as np

from wingfit.records.array_types import Complex


@dataclass(frozen=True)
class FourierSeries:
    """An angle (rad) over the beat: mean + sum_k [cosine[k-1] cos(k psi) + sine[k-1] sin(k psi)], k = 1, 2, ...

    psi is the phase of the beat, from 0 to 2 pi; all coefficients are in rad.
    """

    mean: float
    cosine: tuple[float, ...]
    sine: tuple[float, ...]
    kind: Literal["fourier"] = "fourier"

    @property
    def series(self) -> Complex:
        """Complex coefficients c_0, ..., c_K (rad) of the angle written as Re sum_k c_k exp(i k psi); K harmonics."""
        pairs = zip_longest(self.cosine, self.sine, fillvalue=0.0)
        return np.array([self.mean, *(complex(c, -s) for c, s in pairs)], np.complex128)


class FourierDrive(FourierSeries):
    """Flap angle of the driving rods as a Fourier series of the drive phase psi, which grows by 2 pi in a beat."""


@dataclass(frozen=True)
class FourBarDrive:
    """Crank-rocker four-bar linkage: a motor turns the crank, the rocker carries the driving rod.

    From van der Grinten's thesis, III-F. Lengths of the links in m; ``ground`` is the distance of the two fixed pivots.
    The crank angle equals the drive phase psi. ``offset`` (rad) is added to the rocker angle so that the wing is
    horizontal at zero flap angle.
    """

    ground: float
    crank: float
    coupler: float
    rocker: float
    offset: float
    kind: Literal["four_bar"] = "four_bar"


Drive = FourierDrive | FourBarDrive
