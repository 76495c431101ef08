"""Whether the noise is known well enough for a model to be called adequate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.inference.noise.series import EXCEEDS, MEASURED_ERROR
from wingfit.inference.noise.steadiness import steady_probability
from wingfit.records import Series
from wingfit.records.array_types import Array, Float

UNEVEN = 3.0  # times the noise of quieter recordings
QUIET = 0.25  # quantile of the recordings' noise that counts as quiet
FAINT = 0.1  # standard error of the mean beat over its size
LOUD = 3.0  # times the visible noise; first-order noise with a correlation of 0.8 has as much
EXCEEDING = 1.5  # times the assumed noise: power of an octave that is compared between recordings and times
BY_CHANCE = 1e-3  # probability that noise as assumed is so much smaller than its standard deviation


def noise_may_hide(data: WhitenedData, nominal: Fit) -> bool:
    """Return whether missing physics may hide in the noise; ``nominal``: fit of the nominal model."""
    if data.kind != "series":
        return bool(noisier(data)) or faint(data) or understated(data)
    return overstated(data, nominal) or uncertain(data, nominal) or loud(data)


def noisier(data: WhitenedData) -> list[int]:
    """Return the indices of recordings with a beat that have several times the noise of quieter ones.

    Noise below the tolerance of any model hides nothing.
    """
    return np.flatnonzero(data.noise_of_recordings > max(UNEVEN * quiet_noise(data), data.tolerance)).tolist()


def faint(data: WhitenedData) -> bool:
    """Return whether the mean beats are known to no better than a tenth of their motion or force, FAINT.

    Flaps of an animal differ from each other, and few of them are recorded; physics may hide in what differs.
    """
    return bool(np.median(data.uncertainty_of_beats) > FAINT)


def understated(data: WhitenedData) -> bool:
    """Return whether what differs between beats is several times the stated noise, in half of the recordings or more.

    Something else changes from beat to beat then, unless the statement is wrong.
    """
    ratios = [fit.stated.ratio for fit in data.beat_fits if fit.stated]
    return bool(ratios) and float(np.median(ratios)) < 1.0 / LOUD


def quiet_noise(data: WhitenedData) -> float:
    """Return the noise of the quieter recordings with a beat (RMS of a sample, m or N)."""
    return float(np.quantile(data.noise_of_recordings, QUIET, method="lower"))


def loud(data: WhitenedData) -> bool:
    """Return whether the noise of a channel, from repeats, periods or as stated, is several times what is known of it.

    That is what its highest frequencies show, and what the dataset states. The rest may be slow noise, or what differs
    between repeats, such as their start, or a motion that is not periodic: one that sags from period to period.
    """
    noises = data.series.noises if data.series else {}
    recorded = [one for one in data.recordings if isinstance(one, Series)]
    levels = np.array([noises[one.name].standard_deviation for one in recorded])
    visible = np.array([noises[one.name].visible for one in recorded])
    stated = np.array([[channel.standard_deviation or np.nan for channel in one.quantities] for one in recorded])
    return _exceeds(levels / visible, LOUD) or _exceeds(levels / stated, EXCEEDS)


def _exceeds(ratios: Float[Array, "R C"], limit: float) -> bool:
    """Return whether the median over R recordings of a channel's ratio is above ``limit``, for any of C channels.

    NaN is a ratio that is not known.
    """
    every = [own[np.isfinite(own)] for own in ratios.T]
    return any(len(own) > 0 and bool(np.median(own) > limit) for own in every)


def residual_to_noise(data: WhitenedData, fit: Fit) -> float:
    """Return the root mean square of the residual of ``fit`` divided by the assumed noise."""
    return float(np.sqrt(max(data.excess(fit.coefficients) + data.noise**2, 0.0)) / data.noise)


def overstated(data: WhitenedData, fit: Fit) -> bool:
    """Return whether the residual is so far below the assumed noise that the noise must be smaller.

    Those coefficients are tested whose assumed noise is far above the residual; genes that were fitted count as
    coefficients that they made small.
    """
    squares = fit.coefficients**2
    loud = data.variance > EXCEEDS**2 * float(np.mean(squares))
    freedom = int(loud.sum()) - len(fit.unit)
    return freedom > 0 and bool(
        scipy.special.chdtr(freedom, float(np.sum(squares[loud] / data.variance[loud]))) < BY_CHANCE
    )


def uncertain(data: WhitenedData, fit: Fit) -> bool:
    """Return whether the residual clearly exceeds the visible noise, and only slow noise could explain that."""
    beyond = data.excess(fit.coefficients) - (data.policy.negligible * data.noise) ** 2 - data.accepted**2
    least, most = sure_error(data), data.excess_standard_error
    return data.policy.refuting_excess * least < beyond <= data.policy.refuting_excess * most


def judged_noise(data: WhitenedData, nominal: Fit) -> WhitenedData:
    """Return ``data``, not steady if slow noise does not explain the residual of the fit ``nominal``.

    It matters only where slow noise is all that could explain it.
    """
    if data.kind != "series" or not uncertain(data, nominal):
        return data
    noises = data.series.noises if data.series else {}
    deviations = [noises[one.name].standard_deviation for one in data.recordings]
    return replace(data, is_steady=steady_probability(nominal.residuals, deviations, EXCEEDING) >= BY_CHANCE)


def sure_error(data: WhitenedData) -> float:
    """Return the standard error of the mean square of the noise of series if none of it was invisible."""
    return MEASURED_ERROR * data.noise**2 + data.excess_standard_error_of_samples
