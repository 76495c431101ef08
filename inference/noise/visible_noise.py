"""The noise of a recording from those of its frequencies where nothing but noise is recorded: the visible noise.

A motion that is sampled fast has no power at the highest frequencies; noise has. White noise plus first-order coloured
noise, with the density S(f) = w + a (1 - r^2) / (1 + r^2 - 2 r cos 2 pi f), f in cycles per sample, is fitted to the
periodogram there (Whittle 1953), down to the frequency below which the recording has more power: there is the signal.

Below that frequency the density is extrapolated. A density that still rises where the noise becomes invisible may rise
to any level, so nothing is estimated then. Noise that looks white may be moderately coloured if few frequencies show
it: this uncertainty is part of the error. Slower noise (the wander of a camera) cannot be seen beside a signal.

The periodogram is that of tapered second differences, divided by their gain: differences remove trends, whose leakage
would cover the noise. What follows an input within a few samples (a current follows a step of the voltage) is no noise
either: it is fitted by the input at neighbouring instants, and subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float

LEAST_SAMPLES = 24
LAGS = 2  # samples around an instant of an input
SPARE = 4  # least number of samples for each of these
HIGHEST, LOWEST = 0.25, 0.004  # cycles per sample: the visible band begins at or below, and is not followed below
STEP = 2.0**-0.5  # ratio of the band's beginning from one extension to the next
MORE = 1.5  # times the fitted noise: a band with more power holds signal, with less another noise
STEEPEST_FLANK = 1.7  # largest ratio of the power in the lower to the upper half of the first band: noise has 1.4
CHANCE = 2.5  # standard errors of a mean power that are allowed beyond
SPREAD = 1.5  # of a periodogram with a Hann taper: neighbouring values are not independent
COMPATIBLE = 4.6  # of minus twice the log-likelihood: 90 % region of two parameters
MODERATE = 0.7  # correlation of the most coloured noise that noise which looks white may be
MOST_RISE = 4.0  # times the density where noise becomes invisible: more is not extrapolated
CORRELATIONS = np.array([0.0, *np.linspace(0.1, 0.9, 17), 0.93, 0.95, 0.97, 0.98, 0.99])
SHARES = np.linspace(0.0, 1.0, 11)  # of the coloured noise in the variance
ERROR = 0.05  # least relative error of the variance
MOST_ERROR = 2.0  # largest: slow noise of more than three times the visible noise is taken for misfit


class VisibleNoise(NamedTuple):
    """White noise of variance ``white`` plus first-order noise of variance ``coloured`` and correlation ``lag1``.

    ``start``: lowest frequency (cycles per sample) where it is visible; ``error``: relative standard error of its
    density below.
    """

    white: float
    coloured: float
    lag1: float
    start: float
    error: float

    @property
    def variance(self) -> float:
        """Total variance."""
        return self.white + self.coloured

    def density(self, frequency: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the spectral density [n] at ``frequency`` [n] (cycles per sample); its mean is the variance."""
        return np.asarray(self.white + self.coloured * _colour(frequency, self.lag1))


def visible_noise(
    values: Float[Array, " T"], stated: float | None = None, inputs: Sequence[Float[Array, " T"]] = ()
) -> VisibleNoise | None:
    """Estimate the noise in ``values`` [T], evenly sampled; None if no frequency shows it, or if it rises too far.

    ``stated``: standard deviation of the noise, if it is known; its colour is estimated then. ``inputs``: what drives
    the rig, at the same instants.
    """
    if len(values) < LEAST_SAMPLES or not np.ptp(values) > 0.0:
        return None
    frequency, power = periodogram(values, inputs)
    start = HIGHEST
    upper, lower = power[frequency >= 0.375], power[(frequency >= HIGHEST) & (frequency < 0.375)]
    if upper.mean() <= 0.0 or lower.mean() > STEEPEST_FLANK * upper.mean() * (1.0 + _chance(lower) + _chance(upper)):
        return None
    found = _fit(frequency, power, start, stated)
    while start * STEP >= max(LOWEST, 3.0 / len(values)):
        band = (frequency >= start * STEP) & (frequency < start)
        if band.any():
            ratio = float(power[band].mean() / found.density(frequency[band]).mean())
            margin = MORE * (1.0 + _chance(power[band]))
            if not 1.0 / margin < ratio < margin:
                break
        start *= STEP
        found = _fit(frequency, power, start, stated)
    around = found.density(np.array([0.0, start]))
    return found if stated is not None or around[0] <= MOST_RISE * around[1] else None


def periodogram(
    values: Float[Array, " T"], inputs: Sequence[Float[Array, " T"]] = ()
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Return frequencies (cycles per sample) above zero and the density of ``values`` [T] there; mean: the variance.

    What follows the ``inputs`` within LAGS samples is left out.
    """
    second = _without(np.diff(values, 2), [np.diff(one, 2) for one in inputs])
    taper = scipy.signal.windows.hann(len(second) + 2)[1:-1]
    power = np.abs(np.fft.rfft(second * taper)) ** 2 / (taper**2).sum()
    frequency = np.arange(len(power)) / len(second)
    return frequency[1:], power[1:] / (2.0 * np.sin(np.pi * frequency[1:])) ** 4


def _without(second: Array, inputs: Sequence[Array]) -> Array:
    """Return second differences [n] without the part that those of ``inputs`` [n] at neighbouring instants explain."""
    columns = [np.roll(one, lag) for one in inputs for lag in range(-LAGS, LAGS + 1) if np.ptp(one) > 0.0]
    if not columns or len(second) < SPARE * len(columns):
        return second
    design = np.stack(columns, axis=1)
    left = second - design @ np.linalg.lstsq(design, second, rcond=None)[0]
    return np.asarray(left * np.sqrt(len(second) / (len(second) - len(columns))))


def _chance(power: Array) -> float:
    return float(CHANCE * np.sqrt(SPREAD / max(len(power), 1)))


def _colour(frequency: Array, lag1: float | Array) -> Array:
    """Return the density of first-order noise of variance one."""
    return np.asarray((1.0 - lag1**2) / (1.0 + lag1**2 - 2.0 * lag1 * np.cos(2.0 * np.pi * frequency)))


def _fit(frequency: Array, power: Array, start: float, stated: float | None) -> VisibleNoise:
    """Fit the two kinds of noise to the ``power`` at and above the frequency ``start``."""
    seen = frequency >= start
    colour = _colour(frequency, CORRELATIONS[:, None])[:, None]  # [correlations, 1, frequencies]
    shape = 1.0 - SHARES[:, None] + SHARES[:, None] * colour
    inside, count = shape[..., seen], int(seen.sum())
    scale = (power[seen] / inside).mean(axis=-1) if stated is None else np.full(shape.shape[:2], stated**2)
    misfit = np.log(inside).sum(axis=-1) + count * np.log(scale) + (power[seen] / inside).sum(axis=-1) / scale
    cost = 2.0 * misfit / SPREAD
    plain = cost[0, 0]  # white noise alone is preferred, unless a colour is clearly better (Schwarz 1978)
    best = np.unravel_index(int(np.argmin(cost)), cost.shape)
    if plain - cost[best] < 2.0 * np.log(max(count, 2)):
        best = (np.intp(0), np.intp(0))
    moderate = cost[CORRELATIONS <= MODERATE] <= cost.min() + COMPATIBLE
    levels = (scale * (1.0 - SHARES + SHARES * _colour(np.zeros(1), CORRELATIONS[:, None])))[CORRELATIONS <= MODERATE]
    share, variance = float(SHARES[best[1]]), float(scale[best])
    found = variance * (1.0 - share), variance * share, float(CORRELATIONS[best[0]])
    own = float(VisibleNoise(*found, start, 0.0).density(np.zeros(1))[0])
    rise = max(float(levels[moderate].max(initial=own)) / own, 1.0)
    error = float(np.hypot(ERROR + (rise - 1.0) / 2.0, np.sqrt(SPREAD / max(count, 1))))
    return VisibleNoise(*found, start, min(error, MOST_ERROR))
