"""Noise that differs between beats: the covariance of an estimate, from sums over single beats.

The scatter of measured forces increases and decreases with the forces themselves, since the flow separates anew in
every beat. Such noise is not stationary within the beat, so that a formula for stationary noise
(:mod:`wingfit.inference.noise.coloured`) gives too small an error for a gene that acts where the scatter is large, and
too large an error for one that acts elsewhere. From beat to beat the noise is stationary. So the scores S^T R^-1 v (S:
sensitivities to the genes, R: noise covariance, v: residuals) are summed over each whole beat, and the covariance of
their total is estimated from the series of these sums, with a flat-topped taper (Politis and Romano 1995; for scores:
Newey and West 1987).
"""

from __future__ import annotations

import numpy as np

from wingfit.inference.noise.mean_beat import fourier_basis, scatter_about
from wingfit.records import Recording
from wingfit.records.array_types import Array, Bool, Float, Index, Mask

FEWEST_MEAN = 3  # fewest beats that separate a mean beat from noise
HARMONICS = 8  # of the mean beat
ENOUGH = 24  # fewest beats of all recordings for which the covariance is estimated from the series of beats
FEWEST = 8  # fewest beats of each recording for the same
TAPER = np.array([1.0, 1.0, 1.0, 0.5])  # of lags 0, 1, 2, 3 beats
WHOLE = 0.9  # fraction of the median number of samples that a whole beat must have


def beat_scores(
    record: Recording, white: Float[Array, "T C"], sensitivity: Float[Array, "T C F"], seen: Bool[Mask, "T C0"]
) -> tuple[Float[Array, "B F"], float]:
    """Sum sensitivity times whitened residual over each whole beat.

    Returns the sums [B, F] (B whole beats, F genes), and the fraction of all samples seen that lie in whole beats.
    ``white`` [T, C]: whitened residuals, zero where nothing was recorded; ``sensitivity`` [T, C, F]: their derivatives.
    ``seen`` [T, C0]: True for recorded values of all C0 >= C channels.
    """
    beat = _beats(record)
    scores = np.zeros((int(beat[-1]) + 1, sensitivity.shape[2]))
    np.add.at(scores, beat, np.einsum("tcp,tc->tp", sensitivity, white))
    count = np.bincount(beat, weights=seen.any(axis=1))
    whole = count >= WHOLE * np.median(count[count > 0])
    return scores[whole], float(count[whole].sum() / count.sum())


def beat_score_covariance(scores: Float[Array, "B F"], samples_used: float, absorbed: float) -> Float[Array, "F F"]:
    """Covariance [F, F] of the sum of all scores of a recording, from the ``scores`` [B, F] of its B whole beats.

    ``samples_used``: fraction of the samples that lie in whole beats; the result is scaled up to all samples. A fit to
    this recording alone makes its scores add up to zero, which lowers the tapered sum over lags k (in beats) by the
    fraction sum_k taper_k (B - |k|) / B^2. A fit to several recordings lowers it by the part ``absorbed`` (0 to 1) of
    this fraction. The result is corrected for this decrease.
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
    """Subtract from the whitened residuals ``white`` [T, C] of a recording their mean beat; entries of zero stay zero.

    The mean beat of the residuals is misfit of the model and not noise. ``beats``: whole beats recorded; with fewer
    than FEWEST_MEAN, ``white`` is returned unchanged. The result is scaled by sqrt(B / (B - 1)), B beats, because the
    mean beat absorbs some of the noise.
    """
    if beats < FEWEST_MEAN:
        return white
    psi = 2 * np.pi * record.condition.flap_frequency * record.times
    widened = np.sqrt(beats / (beats - 1.0))
    return np.asarray(scatter_about(fourier_basis(psi, HARMONICS), white, white != 0.0) * widened)


def _beats(record: Recording) -> Index:
    """Index [T] of the beat in which each sample lies; 0 for that of the first sample."""
    beat = np.floor(record.times * record.condition.flap_frequency + 1e-6).astype(np.int64)
    return np.asarray(beat - beat[0])


def widening(beats: float) -> float:
    """Factor by which a variance that was estimated from this number of beats is enlarged.

    A variance from B beats has about nu = B / sum_k taper_k^2 degrees of freedom. An error divided by the estimated
    standard deviation then follows Student's t, whose variance is nu / (nu - 2), the factor returned.
    """
    freedom = beats / float(TAPER[0] ** 2 + 2 * (TAPER[1:] ** 2).sum())
    return freedom / (freedom - 2.0)
