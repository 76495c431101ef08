"""The noise of recordings without a beat: from repeats, from the period, as stated, or from the highest frequencies.

The noise of a channel is described by its standard deviation and by its spectral density at the coefficients of a
discrete cosine transform of its samples (orthonormal, type II). White noise of variance s has density s at all of them.

- **Repeats**: recordings of one experiment differ by noise alone. The density is that of their differences.
- **Period**: the residual of a periodic recording after its harmonics is noise (at least three periods).
- **Stated**: white noise of the stated standard deviation.
- **Highest frequencies**: sampled fast enough, a motion has no power in the upper half of the frequencies, and white
  noise has. This is refused where the power there is not flat, since then it is not white noise, or not noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import scipy

from wingfit.inference.noise.mean_beat import fourier_basis
from wingfit.records.array_types import Array, Float
from wingfit.records.series import Series, difference_of_repeats

Source = Literal["repeats", "period", "stated", "highest frequencies"]

LEAST_SAMPLES = 24  # of a channel whose noise is estimated from its highest frequencies
LEAST_PERIODS = 3.0
BANDS_PER_OCTAVE = 2.0
LEAST_PER_BAND = 6  # coefficients
FLAT_RATIO = 2.0  # largest ratio of the densities in two bands of white noise, beyond chance
CHANCE = 3.0  # standard errors of that ratio
STATED_ERROR = 0.15  # standard error of a stated variance, relative
MEASURED_ERROR = 0.05  # the least for one that is estimated: it is not exactly white, or stationary
FLOOR = 1e-6  # of the largest value: smallest standard deviation
QUANTUM = 1e-6  # relative distance from a multiple of the smallest step within which values are quantised
EXCEEDS = 2.0  # times: a stated and an estimated standard deviation that differ by more get a remark


@dataclass(frozen=True)
class SeriesNoise:
    """Noise of the C channels of one recording of T samples.

    Attributes:
        standard_deviation: [C] of one sample, in the unit of the channel.
        density: [C, T] spectral density at the coefficients of the cosine transform, divided by the variance.
        relative_error: standard error of the variance, relative.
        source: where it comes from.
        high: [C] standard deviation that white noise with the power of the highest frequencies would have; NaN if that
            is not flat.
    """

    standard_deviation: Float[Array, " C"]
    density: Float[Array, "C T"]
    relative_error: float
    source: Source
    high: Float[Array, " C"]


class UnknownNoiseError(ValueError):
    """Raised for a recording whose noise is neither stated nor can be estimated; the message says what to do."""


def noise_of(recordings: Sequence[Series]) -> dict[str, SeriesNoise]:
    """Return the noise of each of ``recordings`` by name; UnknownNoiseError if that of one cannot be known."""
    by_repeats = dict(_from_repeats(recordings))
    return {one.name: by_repeats.get(one.name) or _alone(one) for one in recordings}


def _alone(recording: Series) -> SeriesNoise:
    """Noise of a recording that was not repeated."""
    high, error = _highest(recording)
    if recording.period is not None and np.ptp(recording.times) >= LEAST_PERIODS * recording.period:
        return _from_period(recording, high)
    floor = _floor(recording)
    stated = recording.standard_deviation
    if stated is not None:
        white = np.ones(recording.values.T.shape)
        return SeriesNoise(np.maximum(stated, floor), white, STATED_ERROR, "stated", high)
    found = np.where([one.standard_deviation is None for one in recording.quantities], np.maximum(high, floor), np.nan)
    for k, channel in enumerate(recording.quantities):
        if channel.standard_deviation is not None:
            found[k] = max(channel.standard_deviation, floor[k])
        elif not np.isfinite(high[k]):
            raise UnknownNoiseError(_unknown(recording, k))
    return SeriesNoise(found, np.ones(recording.values.T.shape), error, "highest frequencies", high)


def _unknown(recording: Series, column: int) -> str:
    name, count = recording.channels[column], int(recording.valid[:, column].sum())
    why = (
        f"it has {count} samples, and an estimate needs {LEAST_SAMPLES}"
        if count < LEAST_SAMPLES
        else "the power of its highest frequencies is not flat, so it is not white noise alone"
    )
    return (
        f"recording {recording.name!r}: the noise of channel {name!r} is not known: {why}; state its "
        f"standard_deviation ({recording.quantities[column].unit}) in the dataset, or record the same experiment at "
        "least twice and give these recordings the same name under repeats"
    )


def _from_repeats(recordings: Sequence[Series]) -> Iterator[tuple[str, SeriesNoise]]:
    """Yield name and noise of the recordings that were repeated."""
    groups: dict[str, list[Series]] = {}
    for one in recordings:
        if one.repeats:
            groups.setdefault(one.repeats, []).append(one)
    for group in groups.values():
        if len(group) < 2:
            continue
        first = group[0]
        for other in group[1:]:
            _check_repeat(first, other)
        values = np.stack([one.values for one in group])
        apart = np.nan_to_num(values - np.mean(values, axis=0))  # missing in one: no difference in any
        power = (cosine_transform(apart) ** 2).sum(axis=0).T / (len(group) - 1.0)  # [C, T]
        seen = np.isfinite(values).all(axis=0).mean(axis=0)
        power = power / np.maximum(seen, 1.0 / len(first.times))[:, None]
        variance = np.maximum(power.mean(axis=1), _floor(first) ** 2)
        density = np.stack([smoothed(own) for own in power]) / variance[:, None]
        error = float(np.hypot(MEASURED_ERROR, np.sqrt(2.0 / ((len(group) - 1.0) * len(first.times)))))
        for one in group:
            yield one.name, SeriesNoise(np.sqrt(variance), density, error, "repeats", _highest(one)[0])


def _check_repeat(first: Series, other: Series) -> None:
    """ValueError if ``other`` does not repeat the experiment of ``first``."""
    what = difference_of_repeats(first, other)
    if what:
        raise ValueError(
            f"recordings {first.name!r} and {other.name!r} repeat {first.repeats!r}, but have different {what}; "
            "resample them to the same, or remove 'repeats'"
        )


def _from_period(recording: Series, high: Array) -> SeriesNoise:
    """Noise of a periodic recording: what its harmonics leave."""
    times, period = recording.times, float(recording.period or 0.0)
    step = float(np.median(np.diff(times)))
    periods = np.ptp(times) / period
    harmonics = max(int(min(0.45 * period / step, len(times) / 4.0, 0.4 * len(times) / periods)), 1)
    basis = fourier_basis(2 * np.pi * times / period, harmonics)
    left = np.zeros(recording.values.shape)
    for k, seen in enumerate(recording.valid.T):
        own, values = basis[seen], recording.values[seen, k]
        left[seen, k] = values - own @ np.linalg.lstsq(own, values, rcond=None)[0]
    freedom = np.maximum(recording.valid.sum(axis=0) - basis.shape[1], 1)
    variance = np.maximum((left**2).sum(axis=0) / freedom, _floor(recording) ** 2)
    power = (cosine_transform(left) ** 2).T
    density = np.stack([smoothed(own) for own in power])
    density = density / np.maximum(density.mean(axis=1, keepdims=True), 1e-300)
    error = float(np.hypot(MEASURED_ERROR, np.sqrt(2.0 / freedom.min())))
    return SeriesNoise(np.sqrt(variance), density, error, "period", high)


def _highest(recording: Series) -> tuple[Array, float]:
    """Return the standard deviation [C] of white noise with the power of the highest frequencies, and its error.

    NaN where that power is not flat, so that it is not that of white noise. The error is relative, of the variance.
    """
    found, counts = np.full(recording.values.shape[1], np.nan), [LEAST_SAMPLES]
    for k, seen in enumerate(recording.valid.T):
        values = recording.values[seen, k]
        if len(values) >= LEAST_SAMPLES:
            found[k] = np.sqrt(_flat_power(values))
            counts.append(len(values))
    return found, float(np.hypot(MEASURED_ERROR, np.sqrt(8.0 / min(counts[1:] or counts))))


def _flat_power(values: Array) -> float:
    """Return the density of ``values`` [T] in the upper half of their frequencies; NaN if it is not flat there.

    Second differences remove trends, whose leakage would otherwise cover the noise; a taper that of the ends.
    """
    second = np.diff(values, 2)
    taper = scipy.signal.windows.hann(len(second) + 2)[1:-1]
    power = np.abs(np.fft.rfft(second * taper)) ** 2 / (taper**2).sum()
    frequency = np.arange(len(power)) / len(second)
    with np.errstate(divide="ignore", invalid="ignore"):
        density = power / (2.0 * np.sin(np.pi * frequency)) ** 4
    upper = float(density[frequency >= 0.25].mean())
    for low, middle, high in ((0.125, 0.25, 0.51), (0.25, 0.375, 0.51)):
        one, other = ((density[(frequency >= a) & (frequency < b)]) for a, b in ((low, middle), (middle, high)))
        if min(len(one), len(other)) < 3:
            continue
        by_chance = CHANCE * np.sqrt(2.0 * (1.0 / len(one) + 1.0 / len(other)))  # neighbours are not independent
        ratio = np.log(max(one.mean(), 1e-300) / max(other.mean(), 1e-300))
        if abs(ratio) <= np.log(FLAT_RATIO) + by_chance and (one.mean() > 0 or other.mean() > 0):
            return upper
    return 0.0 if upper == 0.0 else float("nan")


def _floor(recording: Series) -> Array:
    """Return the least standard deviation [C]: that of rounding to the smallest step, or of round-off."""
    found = np.zeros(recording.values.shape[1])
    for k, seen in enumerate(recording.valid.T):
        values = recording.values[seen, k]
        largest = float(np.abs(values).max(initial=0.0))
        found[k] = max(FLOOR * largest, quantum(values) / np.sqrt(12.0), 1e-300)
    return found


def quantum(values: Float[Array, " T"]) -> float:
    """Return the step of which all differences between ``values`` [T] are multiples, as of an encoder; 0 if none is."""
    levels = np.unique(values)
    if not 3 <= len(levels) <= max(len(values) // 2, 3):  # almost every value is different: not quantised
        return 0.0
    steps = np.diff(levels)
    step = float(steps.min())
    multiples = steps / step
    return step if np.abs(multiples - np.round(multiples)).max() <= max(QUANTUM * multiples.max(), 1e-3) else 0.0


def smoothed(power: Array) -> Array:
    """Return ``power`` [T] averaged in bands of a fraction of an octave, each of LEAST_PER_BAND values or more."""
    edges, found = [0], np.empty_like(power)
    while edges[-1] < len(power):
        edges.append(max(edges[-1] + LEAST_PER_BAND, int(edges[-1] * 2.0 ** (1.0 / BANDS_PER_OCTAVE))))
    if len(edges) > 2 and len(power) - edges[-2] < LEAST_PER_BAND:
        del edges[-2]
    for low, high in pairwise(edges):
        found[low:high] = power[low:high].mean()
    return found


def cosine_transform(values: Float[Array, "*B T C"]) -> Float[Array, "*B T C"]:
    """Return the orthonormal cosine transform of ``values`` [..., T, C] along time."""
    return np.asarray(scipy.fft.dct(values, norm="ortho", axis=-2))
