"""A recording without a beat as coefficients of a cosine transform, with the noise of these coefficients."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.inference.noise.series import SeriesNoise, Source, cosine_transform, noise_of, smoothed
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.records.series import Series

LEAST_SAMPLES = 8  # of a channel that is used
SIGNAL = 2.0  # times the noise: coefficients of the recording with more power hold signal
WIDER = 4.0  # times the highest frequency of the signal: frequencies up to there are compared
LEAST_COEFFICIENTS = 64


@dataclass(frozen=True)
class SeriesFit:
    """Linear map from the samples [T, C] of a recording to P coefficients per channel, and their noise.

    Coefficients are those of the cosine transform, lowest frequencies first, in units of the channel's ``scale``. What
    was not recorded counts as no residual.

    Attributes:
        scale: [C] by which the values of each channel are divided, in its unit.
        used: [C], False for a channel with too few samples.
        seen: [C] fraction of the samples that were recorded.
        weight: [P] contribution of the square of a coefficient to the mean square of a channel.
        variance: [C, P] of the noise of the coefficients.
        noise: [C] standard deviation of the noise at the P coefficients, in scales.
        lag1: correlation of the noise of successive samples, mean over the channels.
        relative_error: standard error of the variance of the noise, relative.
        source: where the noise is known from.
        features: number of coefficients that hold most of what was recorded: a smooth fall has two, a swing many.
    """

    scale: Float[Array, " C"]
    used: Bool[Mask, " C"]
    seen: Float[Array, " C"]
    weight: Float[Array, " P"]
    variance: Float[Array, "C P"]
    noise: Float[Array, " C"]
    lag1: float
    relative_error: float
    source: Source
    features: float

    def of(self, residuals: Float[Array, "*B T C"]) -> Float[Array, "*B C P"]:
        """Coefficients [..., C, P] of ``residuals`` [..., T, C] (NaN: not recorded)."""
        filled = np.where(np.isfinite(residuals), residuals, 0.0) / (self.scale * np.sqrt(self.seen))
        return np.asarray(np.moveaxis(cosine_transform(filled), -1, -2)[..., : len(self.weight)])


@dataclass(frozen=True)
class SeriesReduction:
    """Reduces recordings of one dataset to coefficients, all in the same scale of each channel.

    ``noises`` of the recordings by name; ``scale`` [C] of the channels, in their units: their noise.
    """

    noises: Mapping[str, SeriesNoise]
    scale: Float[Array, " C"]

    @classmethod
    def of(cls, recordings: Sequence[Series], fitted: Sequence[Series] = ()) -> SeriesReduction:
        """Estimate the noise of all ``recordings``; ValueError if that of one cannot be known.

        The scale of a channel is its noise in the recordings ``fitted``; none: in all.
        """
        noises = noise_of(recordings)
        inside = np.array([_in_band(one, noises[one.name]) for one in fitted or recordings])
        with np.errstate(invalid="ignore"):
            means = np.where(np.isfinite(inside), inside, 0.0).sum(axis=0) / np.isfinite(inside).sum(axis=0)
        return cls(noises, np.sqrt(np.where(np.isfinite(means), means, 1.0)))

    def __call__(self, recording: Series) -> SeriesFit:
        """Reduce ``recording``; ValueError if no channel has enough samples."""
        noise, count = self.noises[recording.name], recording.valid.sum(axis=0)
        if not (count >= LEAST_SAMPLES).any():
            raise ValueError(
                f"recording {recording.name!r}: the fullest channel has {int(count.max(initial=0))} samples; a "
                f"diagnosis needs {LEAST_SAMPLES}: record more, or leave the recording out"
            )
        width = band(recording, noise)
        deviation = np.where(np.isfinite(noise.standard_deviation), noise.standard_deviation, self.scale)
        variance = (deviation / self.scale)[:, None] ** 2 * _density(noise, width)
        turns = np.cos(np.pi * np.arange(noise.density.shape[1]) / noise.density.shape[1])
        return SeriesFit(
            self.scale,
            np.asarray((count >= LEAST_SAMPLES) & np.isfinite(noise.standard_deviation)),
            np.maximum(recording.valid.mean(axis=0), 1.0 / len(recording.times)),
            np.full(width, 1.0 / width),
            variance,
            np.sqrt(variance.mean(axis=1)),
            float((noise.density * turns).mean()),
            noise.relative_error,
            noise.source,
            features(recording, noise),
        )


def _in_band(recording: Series, noise: SeriesNoise) -> Array:
    return np.asarray(noise.standard_deviation**2 * _density(noise, band(recording, noise)).mean(axis=1))


def _density(noise: SeriesNoise, width: int) -> Array:
    """Return the density [C, width] of the lowest frequencies.

    The error of rounding a slow motion lies there with all of its power.
    """
    whole = noise.density.shape[1] / width if noise.source == "resolution" else 1.0
    return np.asarray(whole * noise.density[:, :width])


def band(recording: Series, noise: SeriesNoise) -> int:
    """Return the number of coefficients to compare, lowest frequencies first.

    Far above the highest frequency that was recorded, a residual is noise, which would only hide what lies below.
    """
    last = LEAST_COEFFICIENTS
    for power, expected in _powers(recording, noise):
        (above,) = np.nonzero(smoothed(power) > SIGNAL * expected)
        last = max(last, int(WIDER * (above.max(initial=0) + 1)))
    return min(last, len(recording.times))


def features(recording: Series, noise: SeriesNoise) -> float:
    """Return the number of coefficients that hold most of what was recorded beyond the noise: sum^2 / sum of squares.

    As many independent samples, about, has the error of a model: a smooth motion cannot contradict a model often.
    """
    beyond = np.sum([np.maximum(own / expected - SIGNAL, 0.0) for own, expected in _powers(recording, noise)], axis=0)
    return float(max(np.sum(beyond) ** 2 / max(np.sum(beyond**2), 1e-300), 1.0))


def _powers(recording: Series, noise: SeriesNoise) -> Iterator[tuple[Array, Array]]:
    """Yield, for each channel with enough samples, the power [T] of its coefficients and that of their noise.

    A quadratic trend is removed first: its leakage into high frequencies is not signal.
    """
    times = recording.times
    powers = np.vander((times - times.mean()) / max(float(np.ptp(times)), 1e-300), 3)
    for k, seen in enumerate(recording.valid.T):
        if seen.sum() < LEAST_SAMPLES:
            continue
        values = np.where(seen, recording.values[:, k], 0.0)
        trend = powers @ np.linalg.lstsq(powers[seen], values[seen], rcond=None)[0]
        left = np.where(seen, values - trend, 0.0)
        yield cosine_transform(left[:, None])[:, 0] ** 2, noise.density[k] * noise.standard_deviation[k] ** 2
