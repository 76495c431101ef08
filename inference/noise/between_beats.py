"""Noise that differs between beats: the covariance of an estimate from the scores of single beats.

The scatter of measured forces grows and falls with the forces themselves, since the flow separates anew in every beat.
Such noise is not stationary within the beat. A formula for stationary noise (:mod:`wingfit.inference.noise.coloured`)
gives too small an error to a gene that acts where the scatter is large, and too large an error to one that acts
elsewhere. From beat to beat the noise is stationary. So the scores S^T R^-1 v (S: sensitivities, R: noise covariance,
v: residuals) are summed over each whole beat, and the covariance of their sum is estimated from the series of beats
with a flat-topped taper (Politis and Romano 1995; for scores: Newey and West 1987).
"""

from __future__ import annotations

import numpy as np

from wingfit.inference.noise.mean_beat import fourier_basis, scatter_about
from wingfit.records import Recording
from wingfit.records.array_types import Array, Bool, Float, Index, Mask

FEWEST_MEAN = 3  # beats at least, to separate a mean beat from noise
HARMONICS = 8  # of the mean beat
ENOUGH = 24  # beats at least, for the covariance to rest on the series of beats alone
FEWEST = 8  # beats below which the series is not used at all
TAPER = np.array([1.0, 1.0, 1.0, 0.5])  # of lags 0, 1, 2, 3 beats
WHOLE = 0.9  # fraction of the median number of samples that a whole beat must have


def beat_scores(
    record: Recording, white: Float[Array, "T C"], sensitivity: Float[Array, "T C F"], seen: Bool[Mask, "T C0"]
) -> tuple[Float[Array, "B F"], float]:
    """Sums [B, F] over each whole beat of sensitivity [T, C, F] times whitened residual [T, C], 0 where not ``seen``.

    Also returned: the fraction of all samples seen that lie in whole beats.
    """
    beat = _beats(record)
    scores = np.zeros((int(beat[-1]) + 1, sensitivity.shape[2]))
    np.add.at(scores, beat, np.einsum("tcp,tc->tp", sensitivity, white))
    count = np.bincount(beat, weights=seen.any(axis=1))
    whole = count >= WHOLE * np.median(count[count > 0])
    return scores[whole], float(count[whole].sum() / count.sum())


def beat_score_covariance(scores: Float[Array, "B F"], samples_used: float, absorbed: float) -> Float[Array, "F F"]:
    """Covariance [F, F] of the sum of all scores of a recording, from the ``scores`` [B, F] of its B whole beats.

    A fit to this recording alone makes its scores add up to zero. This lowers the tapered sum over lags k by the
    fraction sum_k taper_k (B - |k|) / B^2; in a fit to several recordings, by the part ``absorbed`` (0 to 1) of it.
    The result is corrected for this, and for samples outside whole beats: ``samples_used`` is the fraction within.
    """
    beats = len(scores)
    total, pairs = TAPER[0] * scores.T @ scores, TAPER[0] * beats
    for lag, weight in enumerate(TAPER[1:], 1):
        product = scores[lag:].T @ scores[:-lag]
        total += weight * (product + product.T)
        pairs += 2 * weight * (beats - lag)
    value, axes = np.linalg.eigh(total / (1.0 - absorbed * pairs / beats**2) / samples_used)
    return np.asarray((axes * np.maximum(value, 0.0)) @ axes.T)


def without_mean_beat(record: Recording, white: Float[Array, "T C"], beats: int) -> Float[Array, "T C"]:
    """Whitened residuals [T, C] of a recording with so many whole ``beats``, minus their mean beat; zeros stay zero.

    The mean beat of the residuals is misfit of the model and not noise.
    """
    if beats < FEWEST_MEAN:
        return white
    psi = 2 * np.pi * record.condition.flap_frequency * record.times
    widened = np.sqrt(beats / (beats - 1.0))
    return np.asarray(scatter_about(fourier_basis(psi, HARMONICS), white, white != 0.0) * widened)


def _beats(record: Recording) -> Index:
    """Index [T] of the beat in which each sample lies, from 0."""
    beat = np.floor(record.times * record.condition.flap_frequency + 1e-6).astype(np.int64)
    return np.asarray(beat - beat[0])


def widening(beats: float) -> float:
    """Factor on a variance that was estimated from this number of beats.

    The variance has about nu = B / sum_k taper_k^2 degrees of freedom. An error divided by its root follows Student's
    t, whose variance is nu / (nu - 2), the result.
    """
    freedom = beats / float(TAPER[0] ** 2 + 2 * (TAPER[1:] ** 2).sum())
    return freedom / (freedom - 2.0)
