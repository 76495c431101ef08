"""Noise that a dataset states, compared with what is seen, and used where both agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.records.dataset import Recording

AGREES = 1.5  # largest ratio of stated and seen noise with which the stated one is used


@dataclass(frozen=True)
class Stated:
    """Stated noise of a recording relative to what is seen, both root mean squares over all used channels.

    Attributes:
        ratio: stated divided by seen noise.
        used: whether the noise is as stated; else, it is as seen.
    """

    ratio: float
    used: bool


def stated_noise(
    recording: Recording, variance: Float[Array, " C"], used: Bool[Mask, " C"], *, between_beats: bool
) -> Stated | None:
    """Compare the stated noise of ``recording`` with the seen ``variance`` [C] of ``used`` [C] channels.

    None if no noise is stated. What differs ``between_beats`` is all that a periodic model cannot explain, so the
    stated noise must agree with it. Within a single beat, only the part above the fitted harmonics is seen, and slow
    noise is not; so the stated noise may be larger.
    """
    if recording.standard_deviation is None:
        return None
    ratio = float(np.sqrt(np.mean(recording.standard_deviation[used] ** 2) / np.mean(variance[used])))
    return Stated(ratio, ratio >= 1.0 / AGREES and (ratio <= AGREES or not between_beats))
