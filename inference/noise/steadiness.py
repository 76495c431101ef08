"""Whether residuals can be the noise of a sensor: then their power is the same in all recordings and at all times.

Slow noise and an error of the model may have the same frequencies. But noise of any colour, as long as it is
stationary, has the same power in every recording and in every part of it, while the error of a model grows with the
motion. In each octave of frequency the powers in quarters of recordings are compared by Bartlett's test of equal
variances (Bartlett 1937, Proc. R. Soc. A 160, 268), with as many degrees of freedom as the octave has coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float

QUARTERS = 4
LEAST_FREEDOM = 3.0  # of a quarter of an octave: coefficients
HIGHEST = 0.25  # cycles per sample: upper end of the first octave


def steady_probability(
    residuals: Sequence[Float[Array, "_ C"]],
    noise: Sequence[Float[Array, " C"]],
    exceeding: float,
) -> float:
    """Return the probability that stationary noise has powers as different as ``residuals``; 1 if nothing can be said.

    ``residuals``: of each recording [T, C], NaN where not recorded; ``noise``: standard deviations [C] that are assumed
    for each. Only octaves are compared whose mean power is ``exceeding`` times the assumed white noise.
    """
    statistic = freedom = 0.0
    for channel in range(residuals[0].shape[1]):
        white = [one[:, channel] / sigma[channel] for one, sigma in zip(residuals, noise, strict=True)]
        for cells in _octaves([np.where(np.isfinite(one), one, 0.0) for one in white if np.isfinite(one).any()]):
            power, count = cells.T
            if len(cells) < 2 or power @ count / count.sum() < exceeding:
                continue
            found, degrees = _bartlett(power, count)
            statistic, freedom = statistic + found, freedom + degrees
    return float(scipy.special.chdtrc(freedom, statistic)) if freedom else 1.0


def _octaves(values: Sequence[Float[Array, " _"]]) -> list[Float[Array, "n 2"]]:
    """Return for each octave the mean square and the number of coefficients of each quarter of each recording."""
    spectra = [scipy.fft.dct(one, norm="ortho") for one in values]
    found, high = list[Float[Array, "n 2"]](), HIGHEST
    while True:
        cells = [cell for one in spectra for cell in _quarters(one, high / 2.0, high)]
        if not cells:
            return found
        found.append(np.array(cells))
        high /= 2.0


def _quarters(spectrum: Float[Array, " T"], low: float, high: float) -> list[tuple[float, float]]:
    """Return mean square and number of coefficients of the band from ``low`` to ``high`` (cycles per sample)."""
    first, last = round(2.0 * low * len(spectrum)), round(2.0 * high * len(spectrum))
    count = (last - first) / QUARTERS
    if count < LEAST_FREEDOM:
        return []
    band = np.zeros(len(spectrum))
    band[first:last] = spectrum[first:last]
    share = (last - first) / len(spectrum)  # of the power of white noise
    parts = np.array_split(scipy.fft.idct(band, norm="ortho"), QUARTERS)
    return [(float(np.mean(part**2)) / share, count) for part in parts]


def _bartlett(power: Float[Array, " n"], count: Float[Array, " n"]) -> tuple[float, float]:
    """Return Bartlett's statistic of ``power`` with ``count`` degrees of freedom each, and its own."""
    pooled = float(power @ count / count.sum())
    least = np.finfo(float).tiny
    spread = float(count @ (np.log(pooled) - np.log(np.maximum(power, least))))
    correction = 1.0 + float(np.sum(1.0 / count) - 1.0 / count.sum()) / (3.0 * (len(power) - 1.0))
    return spread / correction, len(power) - 1.0
