"""Locate the misfit of a series: in which channels and recordings, when, and at which frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import ChannelMisfit, Overlay, Where
from wingfit.inference.noise.series_fit import SeriesFit
from wingfit.records.array_types import Array, Float
from wingfit.records.series import Series

PARTS = ("the first third", "the middle third", "the last third")
CONCENTRATED = 0.6  # of the excess: a channel, recording or part of the time with more is named
MOST_POINTS = 2000  # of an overlay


def series_location(data: WhitenedData, coefficients: Float[Array, " D"], residuals: Sequence[Array]) -> Where:
    """Return where a residual lies: ``coefficients`` [D], and ``residuals`` [T, C] of each recording."""
    recordings, fits = _series(data)
    names = recordings[0].channels
    by_channel = np.maximum(_by_channel(data, coefficients), 0.0)
    channel = names[int(np.argmax(by_channel))]
    words = [_share(by_channel, names, "in channel {}")] if len(names) > 1 else [f"in channel {channel}"]
    by_recording = np.maximum(data.excess_by_recording(coefficients) * data.recording_weights, 0.0)
    if len(recordings) > 1:
        words.append(_share(by_recording, [one.name for one in recordings], "in recording {}"))
    words.append(_share(_by_time(fits, residuals), PARTS, "in {} of the time"))
    frequency = _frequency(data, recordings, coefficients)
    words.append(f"at frequencies about {frequency:.2g} Hz" if frequency else "")
    return Where(", ".join(one for one in words if one), None, None, None, channel, ())


def channel_misfits(
    data: WhitenedData, before: Float[Array, " D"], after: Float[Array, " D"]
) -> tuple[ChannelMisfit, ...]:
    """Return the misfit of each channel with residual coefficients ``before`` and ``after`` [D] effects are added."""
    recordings, fits = _series(data)
    excess = [np.sqrt(np.maximum(_by_channel(data, one), 0.0)) for one in (before, after)]
    noises = [data.series.noises[one.name] for one in recordings] if data.series else []
    deviations = np.sqrt(np.mean([one.standard_deviation**2 for one in noises], axis=0))
    sources = " or ".join(dict.fromkeys(one.source for one in noises))
    return tuple(
        ChannelMisfit(
            channel.name,
            channel.unit,
            channel.place,
            float(deviations[c]),
            sources,
            float(excess[0][c] * fits[0].scale[c]),
            float(excess[1][c] * fits[0].scale[c]),
        )
        for c, channel in enumerate(recordings[0].quantities)
    )


def series_overlays(
    data: WhitenedData, before: Sequence[Array], after: Sequence[Array], held_out: bool, most: int = 2
) -> Iterator[Overlay]:
    """Yield the channel that the added effects change most, of each of the ``most`` recordings that they change most.

    Where they change nothing, the channel with the largest misfit of the nominal model. ``before`` and ``after``:
    residuals [T, C] of each recording, simulated minus recorded, without and with the effects.
    """
    recordings, fits = _series(data)
    change = [float(np.nanmean(((b - a) / fits[0].scale) ** 2)) for b, a in zip(before, after, strict=True)]
    for r in np.argsort(change)[::-1][:most]:
        recording = recordings[r]
        apart = before[r] - after[r] if change[r] > 0.0 else before[r]
        channel = int(np.argmax(np.nan_to_num((apart / fits[r].scale) ** 2).sum(axis=0)))
        seen = np.flatnonzero(np.isfinite(before[r][:, channel]))
        seen = seen[:: -(-len(seen) // MOST_POINTS)]
        recorded = recording.values[seen, channel]
        yield Overlay(
            recording.name,
            recording.channels[channel],
            held_out,
            (),
            tuple(recorded.tolist()),
            tuple((recorded + before[r][seen, channel]).tolist()),
            tuple((recorded + after[r][seen, channel]).tolist()),
            tuple(recording.times[seen].tolist()),
            recording.quantities[channel].unit,
        )


def _series(data: WhitenedData) -> tuple[list[Series], list[SeriesFit]]:
    recordings = [one for one in data.recordings if isinstance(one, Series)]
    fits = [one for one in data.reduced if isinstance(one, SeriesFit)]
    if len(recordings) != len(data.recordings) or len(fits) != len(recordings):
        raise TypeError("only the misfit of series is located in time")
    return recordings, fits


def _by_channel(data: WhitenedData, coefficients: Array) -> Array:
    """Return the mean square [C] over the samples of each channel beyond the noise, in squares of its scale."""
    total = np.zeros(len(data.reduced[0].used))
    count = np.zeros(len(total))
    for one, fit, part in zip(data.recordings, data.reduced, data.recording_slices, strict=True):
        own = coefficients[part].reshape(-1, len(fit.weight))
        total[fit.used] += (own**2 - fit.variance[fit.used]).sum(axis=1) / len(one.times)
        count += fit.used
    return np.asarray(total / np.maximum(count, 1))


def _by_time(fits: Sequence[SeriesFit], residuals: Sequence[Array]) -> Array:
    """Return the excess [3] in each third of the recordings."""
    total = np.zeros(len(PARTS))
    for fit, one in zip(fits, residuals, strict=True):
        beyond = (one / fit.scale) ** 2 - fit.noise**2
        total += [np.nansum(part) for part in np.array_split(beyond, len(PARTS))]
    return np.maximum(total, 0.0)


def _share(amounts: Array, names: Sequence[str], words: str) -> str:
    """Return ``words`` with the name that has most of ``amounts``; empty if none has CONCENTRATED of it."""
    total = float(np.sum(amounts))
    k = int(np.argmax(amounts))
    if total <= 0.0 or amounts[k] < CONCENTRATED * total:
        return ""
    return f"{words.format(names[k])} ({100 * amounts[k] / total:.0f} %)"


def _frequency(data: WhitenedData, recordings: Sequence[Series], coefficients: Array) -> float:
    """Return the frequency (Hz) below and above which the excess is equal; 0 if there is none."""
    at, power = list[Array](), list[Array]()
    for recording, fit, part in zip(recordings, data.reduced, data.recording_slices, strict=True):
        own = coefficients[part].reshape(-1, len(fit.weight))
        power.append(((own**2 - fit.variance[fit.used]) * fit.weight).sum(axis=0))
        at.append(np.arange(len(fit.weight)) / (2.0 * max(float(np.ptp(recording.times)), 1e-300)))
    frequency, whole = np.concatenate(at), np.maximum(np.concatenate(power), 0.0)
    order = np.argsort(frequency)
    total = np.cumsum(whole[order])
    return float(frequency[order][np.searchsorted(total, 0.5 * total[-1])]) if total[-1] > 0.0 else 0.0
