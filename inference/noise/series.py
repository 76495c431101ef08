"""The noise of recordings without a beat: from repeats, from the period, as stated, or from the highest frequencies.

The noise of a channel is described by its standard deviation and by its spectral density at the coefficients of a
discrete cosine transform of its samples (orthonormal, type II). White noise of variance s has density s at all of them.

- **Repeats**: recordings of one experiment differ by noise alone. The density is that of their differences.
- **Period**: the residual of the harmonics of a periodic recording is noise (at least three periods).
- **Stated**: noise of the stated standard deviation, of the colour that its visible part has.
- **Highest frequencies**: sampled fast enough, a motion has no power at the highest frequencies, and noise has
  (:mod:`wingfit.inference.noise.visible_noise`). Refused where the power there is not that of noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
import scipy

from wingfit.inference.noise.mean_beat import fourier_basis
from wingfit.inference.noise.visible_noise import LEAST_SAMPLES, VisibleNoise, visible_noise
from wingfit.records.array_types import Array, Float
from wingfit.records.series import Series, difference_of_repeats

Source = Literal["repeats", "period", "stated", "highest frequencies", "resolution", "other recordings"]
SOURCES: tuple[Source, ...] = ("highest frequencies", "resolution", "stated", "period", "repeats")  # least sure first

EVEN = 0.1  # of an interval: largest deviation of one that counts as even
JITTER = 9  # samples: differences of times that last longer are a drift of the clock
LEAST_PERIODS = 3.0
BANDS_PER_OCTAVE = 2.0
LEAST_PER_BAND = 6  # coefficients
STATED_ERROR = 0.15  # standard error of a stated variance, relative
BORROWED_ERROR = 1.0  # of a variance that is assumed to be that of other recordings
MEASURED_ERROR = 0.05  # the least for one that is estimated: noise is not exactly stationary
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
        visible: [C] standard deviation of the noise that the highest frequencies show; NaN if they show none.
    """

    standard_deviation: Float[Array, " C"]
    density: Float[Array, "C T"]
    relative_error: float
    source: Source
    visible: Float[Array, " C"]


class KnownNoise(NamedTuple):
    """What is known of the noise of the C channels of one recording, NaN where nothing is.

    ``standard_deviation`` [C] of one sample, in the unit of the channel; ``relative_error`` [C]: standard error of its
    square, relative.
    """

    standard_deviation: Float[Array, " C"]
    relative_error: Float[Array, " C"]


class UnknownNoiseError(ValueError):
    """Raised for a recording whose noise is neither stated nor can be estimated; the message says what to do."""


def noise_of(recordings: Sequence[Series]) -> dict[str, SeriesNoise]:
    """Return the noise of each of ``recordings`` by name; UnknownNoiseError if that of a channel cannot be known.

    Where one recording does not show the noise of a channel, it is assumed to be the largest of the other recordings.
    """
    found, unknown = dict(_from_repeats(recordings)), list[tuple[Series, UnknownNoiseError]]()
    for one in recordings:
        if one.name not in found:
            try:
                found[one.name] = _alone(one)
            except UnknownNoiseError as error:
                unknown.append((one, error))
    known = list(found.values())
    for one, reason in unknown:
        if not known:
            raise reason
        found[one.name] = _as_others(one, known)
    return found


def known_noise(recordings: Sequence[Series]) -> dict[str, KnownNoise]:
    """Return the noise of each of ``recordings`` by name, channel by channel, where :func:`noise_of` can know it.

    ValueError for repeats that differ in more than noise.
    """
    found = {name: _whole(noise) for name, noise in _from_repeats(recordings)}
    for one in recordings:
        if one.name not in found:
            found[one.name] = _whole(_alone(one)) if _has_periods(one) else _by_channel(one)
    largest = np.fmax.reduce([one.standard_deviation for one in found.values()])
    return {name: _completed(one, largest) for name, one in found.items()}


def _whole(noise: SeriesNoise) -> KnownNoise:
    return KnownNoise(noise.standard_deviation, np.full(len(noise.standard_deviation), noise.relative_error))


def _by_channel(recording: Series) -> KnownNoise:
    found = np.full((2, len(recording.quantities)), np.nan)
    for k in range(len(recording.quantities)):
        with suppress(UnknownNoiseError):
            deviation, _, error, _ = _of_channel(recording, k, _shown(recording, k))
            found[:, k] = max(deviation, FLOOR * float(_largest(recording)[k])), error
    return KnownNoise(*found)


def _completed(noise: KnownNoise, largest: Array) -> KnownNoise:
    """Return ``noise`` with what it does not know replaced by the ``largest`` [C] of other recordings."""
    unknown = np.isnan(noise.standard_deviation)
    errors = np.where(np.isfinite(largest), BORROWED_ERROR, np.nan)
    return KnownNoise(
        np.where(unknown, largest, noise.standard_deviation), np.where(unknown, errors, noise.relative_error)
    )


def _as_others(recording: Series, known: Sequence[SeriesNoise]) -> SeriesNoise:
    """Return the largest of the ``known`` noises of each channel, for a recording that does not show its own."""
    deviations = np.nanmax([one.standard_deviation for one in known], axis=0)
    white, error = np.ones(recording.values.T.shape), max(BORROWED_ERROR, *(one.relative_error for one in known))
    return SeriesNoise(deviations, white, error, "other recordings", np.full(len(deviations), np.nan))


def _alone(recording: Series) -> SeriesNoise:
    """Noise of a recording that was not repeated."""
    shown = [_shown(recording, k) for k in range(len(recording.quantities))]
    if _has_periods(recording):
        return _from_period(recording, _deviations(shown))
    channels = [_of_channel(recording, k, own) for k, own in enumerate(shown)]
    density = np.stack([own for _, own, _, _ in channels])
    sources = {source for *_, source in channels}
    return SeriesNoise(
        np.maximum(np.array([deviation for deviation, *_ in channels]), FLOOR * _largest(recording)),
        density / np.maximum(density.mean(axis=1, keepdims=True), 1e-300),
        max(error for _, _, error, _ in channels),
        min(sources, key=SOURCES.index),
        _deviations(shown),
    )


def _has_periods(recording: Series) -> bool:
    return recording.period is not None and bool(np.ptp(recording.times) >= LEAST_PERIODS * recording.period)


def _of_channel(recording: Series, column: int, own: VisibleNoise | None) -> tuple[float, Array, float, Source]:
    """Return deviation, density [T], relative error and source of a channel's noise; ``own``: the visible noise."""
    values = recording.values[recording.valid[:, column], column]
    if not len(values):  # the channel is not used in this recording
        return float("nan"), np.ones(len(recording.times)), MEASURED_ERROR, "repeats"
    stated, least = recording.quantities[column].standard_deviation, quantum(values) / np.sqrt(12.0)
    frequency = np.arange(len(recording.times)) / (2.0 * len(recording.times))
    own = own if stated is None else _shown(recording, column, stated)
    density = own.density(frequency) if own else np.ones(len(frequency))
    if stated is not None:
        return max(stated, least), density, STATED_ERROR, "stated"
    if least > 0.0 and (own is None or own.variance < EXCEEDS**2 * least**2):  # the error of rounding, which is white
        return (
            max(least, float(np.sqrt(own.variance)) if own else 0.0),
            np.ones(len(frequency)),
            STATED_ERROR,
            "resolution",
        )
    if own is not None:
        return float(np.sqrt(own.variance)), density, own.error, "highest frequencies"
    raise UnknownNoiseError(_unknown(recording, column))


def _even_run(recording: Series, column: int) -> slice:
    """Return the longest run of samples of a channel that are complete and evenly spaced."""
    steps = np.diff(recording.times)
    usual = float(np.median(steps)) if len(steps) else 0.0
    seen = recording.valid[:, column]
    joined = seen[1:] & seen[:-1] & (np.abs(steps - usual) <= EVEN * usual)
    best, begin = slice(0, 0), 0
    for end in [*(np.flatnonzero(~joined) + 1).tolist(), len(seen)]:
        if end - begin > best.stop - best.start:
            best = slice(begin, end)
        begin = end
    return best


def _shown(recording: Series, column: int, stated: float | None = None) -> VisibleNoise | None:
    """Return the noise that the highest frequencies of a channel show, of the ``stated`` deviation if it is known."""
    run = _even_run(recording, column)
    values = at_even_times(recording.times[run], recording.values[run, column])
    return visible_noise(values, stated, [one[run] for one in recording.inputs.values()])


def at_even_times(times: Float[Array, " T"], values: Float[Array, " T"]) -> Float[Array, " T"]:
    """Return ``values`` [T] at evenly spaced times near ``times`` [T], to first order of their differences.

    Else the motion times these differences would look like noise. Differences that accumulate (a clock that drifts) are
    left: they stretch the motion slowly, which no high frequency shows. The noise changes by at most EVEN.
    """
    if len(times) < 3:
        return values
    count = np.arange(len(times))
    even = np.polynomial.Polynomial.fit(count, times, 1)(count)
    apart = times - even
    usual = (times[-1] - times[0]) / (len(times) - 1)
    apart -= scipy.ndimage.uniform_filter1d(apart, JITTER, mode="nearest")
    return np.asarray(values - np.gradient(values, times) * np.clip(apart, -EVEN * usual, EVEN * usual))


def _deviations(shown: Sequence[VisibleNoise | None]) -> Array:
    """Return the standard deviations [C] of visible noises; NaN where a channel shows none."""
    return np.array([np.nan if one is None else np.sqrt(one.variance) for one in shown])


def _unknown(recording: Series, column: int) -> str:
    name, count = recording.channels[column], int(recording.valid[:, column].sum())
    why = (
        f"it has {count} samples, and an estimate needs {LEAST_SAMPLES}"
        if count < LEAST_SAMPLES
        else "no frequency shows noise alone, or slower noise than it shows may be much larger"
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
        variance = np.where(seen > 0.0, np.maximum(power.mean(axis=1), _floor(first) ** 2), np.nan)
        density = np.stack([smoothed(own) for own in power]) / variance[:, None]
        density = np.where(np.isfinite(density), density, 1.0)
        error = float(np.hypot(MEASURED_ERROR, np.sqrt(2.0 / ((len(group) - 1.0) * len(first.times)))))
        for one in group:
            shown = [_shown(one, k) for k in range(len(one.quantities))]
            yield one.name, SeriesNoise(np.sqrt(variance), density, error, "repeats", _deviations(shown))


def _check_repeat(first: Series, other: Series) -> None:
    """ValueError if ``other`` does not repeat the experiment of ``first``."""
    what = difference_of_repeats(first, other)
    if what:
        raise ValueError(
            f"recordings {first.name!r} and {other.name!r} repeat {first.repeats!r}, but have different {what}; "
            "resample them to the same, or remove 'repeats'"
        )


def _from_period(recording: Series, visible: Array) -> SeriesNoise:
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
    lowest = int(
        2.0 * np.ptp(times) / period
    )  # coefficients below the period: the fit has absorbed some of their noise
    density[:, :lowest] = np.maximum(density[:, :lowest], density[:, lowest : 2 * lowest + 1].max(axis=1)[:, None])
    density = density / np.maximum(density.mean(axis=1, keepdims=True), 1e-300)
    error = float(np.hypot(MEASURED_ERROR, np.sqrt(2.0 / freedom.min())))
    return SeriesNoise(np.sqrt(variance), density, error, "period", visible)


def _largest(recording: Series) -> Array:
    """Return the largest absolute value [C] of each channel."""
    return np.asarray(np.maximum(np.where(recording.valid, np.abs(recording.values), 0.0).max(axis=0), 1e-290))


def _floor(recording: Series) -> Array:
    """Return the least standard deviation [C]: that of rounding to the smallest step, or of round-off."""
    steps = [quantum(own[seen]) for own, seen in zip(recording.values.T, recording.valid.T, strict=True)]
    return np.asarray(np.maximum(np.array(steps) / np.sqrt(12.0), FLOOR * _largest(recording)))


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
