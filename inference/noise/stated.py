"""Noise that a dataset states, compared with what is seen, and used where both agree.

Stated are standard deviations of all channels and, of tracks, correlations between the coordinates of a marker.
"""

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
        correlated: whether stated correlations agree with what is seen better than none; None if none are stated, or
            the noise is not used.
    """

    ratio: float
    used: bool
    correlated: bool | None = None


def stated_noise(
    recording: Recording,
    variance: Float[Array, " C"],
    used: Bool[Mask, " C"],
    scatter: Float[Array, "T C"],
    *,
    between_beats: bool,
) -> Stated | None:
    """Compare the stated noise of ``recording`` with the seen ``variance`` [C] of ``used`` [C] channels.

    ``scatter`` [T, C]: what was seen of it, zero for samples that are not used.

    None if no noise is stated. What differs ``between_beats`` is all that a periodic model cannot explain, so the
    stated noise must agree with it. Within a single beat, only the part above the fitted harmonics is seen, and slow
    noise is not; so the stated noise may be larger.
    """
    if recording.standard_deviation is None:
        return None
    ratio = float(np.sqrt(np.mean(recording.standard_deviation[used] ** 2) / np.mean(variance[used])))
    agrees = ratio >= 1.0 / AGREES and (ratio <= AGREES or not between_beats)
    if recording.noise_correlation is None or not agrees:
        return Stated(ratio, agrees)
    return Stated(ratio, agrees, _correlations_agree(recording.noise_correlation[used[::3]], scatter[:, used]))


def correlation_matrices(correlations: Float[Array, "M 3"]) -> Float[Array, "M 3 3"]:
    """Return the matrices [M, 3, 3] of the ``correlations`` [M, 3] of x with y, x with z, and y with z."""
    found = np.tile(np.eye(3), (len(correlations), 1, 1))
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        found[:, i, j] = found[:, j, i] = correlations[:, k]
    return found


def _correlations_agree(correlations: Float[Array, "M 3"], scatter: Float[Array, "T C"]) -> bool:
    """Return whether normal noise with ``correlations`` makes ``scatter`` likelier than independent noise does."""
    samples = np.moveaxis(scatter.reshape(len(scatter), -1, 3), 0, 1)  # [M, T, 3]
    count = np.any(samples != 0.0, axis=2).sum(axis=1)
    sizes = np.sqrt((samples**2).sum(axis=1) / np.maximum(count, 1)[:, None])
    seen = np.einsum("mti,mtj->mij", samples, samples) / np.maximum(sizes[:, :, None] * sizes[:, None, :], 1e-300)
    stated = correlation_matrices(correlations)
    cost = count * np.linalg.slogdet(stated)[1] + np.einsum("mij,mji->m", np.linalg.inv(stated), seen)
    return bool(cost.sum() < np.trace(seen, axis1=1, axis2=2).sum())
