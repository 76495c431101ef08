"""The noise that a new recording is expected to have: as in those that were recorded, or a default."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wingfit.inference.noise.between_beats import TAPER
from wingfit.inference.noise.harmonic import harmonic_fit, whole_markers
from wingfit.inference.noise.mean_beat import fourier_basis
from wingfit.records import Recording
from wingfit.records.array_types import Array, Float

Source = Literal["stated", "recordings", "default"]
TRACKS_MM = 0.5  # of each coordinate: stereo cameras, and markers of a few millimetres (van der Grinten, 5.2)
TRACKS_CORRELATION = 0.6  # of successive frames: the filter of a tracker
FORCES_MN = 3.0  # white noise of the same density as the vibrations of a clamped vehicle at low frequencies
SCATTER = 0.015  # of the force from beat to beat
MEMORY = 0.3  # correlation of the scatter of successive beats
TIMING = 0.0005  # beats: the start of a beat, known from a sensor on the drive
ZERO_MN = 0.5  # of each axis: drift since the zero was measured
TRUSTED_BEATS = 20.0  # beats whose scatter says as much about its memory as is known without
LEAST_BEATS = 6  # from which the scatter of a recording is measured
STEP = 1e-4  # beats, of a derivative
HARMONICS = 3  # of forces: those of which the noise is measured, as a calibration's filter passes them


@dataclass(frozen=True)
class NoiseLevel:
    """Noise of a recording: first-order autoregressive noise, and forces whose amplitude scatters from beat to beat.

    Attributes:
        deviation: [A] standard deviation of one sample along each of A axes (x, y, z of markers; x, z of forces), m or
            N; of forces that of white noise with the density that the noise has at low frequencies.
        correlation: of successive samples.
        scatter: relative standard deviation of the amplitude of a beat; 0 for tracks.
        memory: correlation of the amplitudes of successive beats.
        timing: standard deviation of the start of a beat, in beats; 0 for tracks.
        zero: standard deviation of the zero of a recording, N; 0 for tracks.
        source: of the deviation, and of the scatter.
    """

    deviation: Float[Array, " A"]
    correlation: float
    scatter: float
    memory: float
    timing: float
    zero: float
    source: Source
    source_of_scatter: Source = "default"

    def density(self, cycles: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the spectral density [n] at ``cycles`` [n] per sample, relative to that of white noise."""
        r = self.correlation
        return np.asarray((1.0 - r**2) / (1.0 - 2.0 * r * np.cos(2.0 * np.pi * cycles) + r**2))

    @property
    def scatter_of_mean(self) -> float:
        """Standard deviation of the mean amplitude of B beats, times the square root of B."""
        return self.scatter * float(np.sqrt((1.0 + self.memory) / (1.0 - self.memory)))


def seen_noise(recordings: Sequence[Recording], *, tracks: bool) -> NoiseLevel:
    """Return the noise that ``recordings`` of ``tracks``, or of forces, show; the default where they show none."""
    recorded = [one for one in recordings if one.valid.any()]
    if not recorded:
        return _default(tracks=tracks)
    return (_seen_tracks if tracks else _seen_forces)(recorded)


def _default(*, tracks: bool) -> NoiseLevel:
    if tracks:
        return NoiseLevel(np.full(3, 1e-3 * TRACKS_MM), TRACKS_CORRELATION, 0.0, 0.0, 0.0, 0.0, "default")
    return NoiseLevel(np.full(2, 1e-3 * FORCES_MN), 0.0, SCATTER, MEMORY, TIMING, 1e-3 * ZERO_MN, "default")


def _seen_tracks(recordings: Sequence[Recording]) -> NoiseLevel:
    """Return the mean noise of ``recordings``: that of differences between beats."""
    square, lags = list[Array](), list[float]()
    for one in recordings:
        fit = harmonic_fit(one, whole_markers(one))
        square.append(np.mean((fit.noise**2).reshape(-1, 3)[fit.used[::3]], axis=0))
        lags.append(fit.lag1)
    correlation = float(np.clip(np.mean(lags), 0.0, 0.95))
    return NoiseLevel(np.sqrt(np.mean(square, axis=0)), correlation, 0.0, 0.0, 0.0, 0.0, "recordings")


def _seen_forces(recordings: Sequence[Recording]) -> NoiseLevel:
    """Return the noise of unfiltered ``recordings`` of forces: the scatter of their beats, and the rest.

    The zero of a recording cannot be seen in it, so that its standard deviation is the default.
    """
    found = [fit for one in recordings if (fit := _Beats.of(one)) is not None]
    if not found:
        return _default(tracks=False)
    level = np.sqrt(np.mean([one.square for one in found], axis=0))
    weights = np.array([float(one.beats) for one in found])
    beats, part = float(weights.sum()), weights / weights.sum()
    scatter = float(part @ np.array([one.power[0] for one in found]))
    lasting, timing = (float(part @ np.array([one.lasting[k] for one in found])) for k in (0, 1))
    usual = (1.0 + MEMORY) / (1.0 - MEMORY)
    lasting = _shrunk(lasting, usual * scatter, beats)
    memory = float(np.clip((lasting - scatter) / max(lasting + scatter, 1e-300), 0.0, 0.9))
    spread, start = float(np.sqrt(scatter)), float(np.sqrt(timing))
    return NoiseLevel(level, 0.0, spread, memory, start, 1e-3 * ZERO_MN, "recordings", "recordings")


def _shrunk(found: float, usual: float, beats: float) -> float:
    """Return the weighted mean of what so many ``beats`` show and of the ``usual`` value."""
    return (found * beats + usual * TRUSTED_BEATS) / (beats + TRUSTED_BEATS)


@dataclass(frozen=True)
class _Beats:
    """What differs between the beats of a recording of forces.

    Attributes:
        beats: whole beats.
        square: [2] of the noise along x and z, N^2: the spectral density of the rest between the harmonics, times the
            samples per second; NaN for an axis that was not recorded.
        power: variances of the amplitude of a beat, and of its start (beats).
        lasting: of both, the variance of the mean of many beats, times their number.
    """

    beats: int
    square: Float[Array, " 2"]
    power: tuple[float, float]
    lasting: tuple[float, float]

    @classmethod
    def of(cls, recording: Recording) -> _Beats | None:
        """Fit amplitude and start of every beat of ``recording`` by least squares; None for too few beats."""
        fit = harmonic_fit(
            recording, np.repeat(recording.valid.all(axis=1, keepdims=True), len(recording.forces), axis=1)
        )
        turns = recording.condition.flap_frequency * recording.times
        since = turns - turns[0]
        number, beats = np.floor(since + 1e-9).astype(int), int(np.floor(since[-1] + 1e-6))
        if beats < LEAST_BEATS:
            return None
        seen = recording.valid
        order, series = int(fit.order.max()), fit.coefficients[:, ~fit.trend]
        mean = fourier_basis(2 * np.pi * turns, order) @ series.T
        values = np.where(seen, recording.values - mean, 0.0)
        # Vibrations are large at the higher harmonics, which a calibration's filter does not pass.
        slow = series[:, fit.order[~fit.trend] <= HARMONICS]
        now, later = (fourier_basis(2 * np.pi * (turns + step), HARMONICS) @ slow.T for step in (0.0, STEP))
        shapes = np.stack([np.where(seen, now, 0.0), np.where(seen, (later - now) / STEP, 0.0)])
        own, inverse = np.empty((beats, 2)), np.zeros((2, 2))
        for k in range(beats):
            part = shapes[:, number == k].reshape(2, -1)
            gram = part @ part.T
            own[k] = np.linalg.solve(gram, part @ values[number == k].ravel())
            inverse += np.linalg.inv(gram) / beats
        moved = np.stack([np.interp(since, np.arange(beats) + 0.5, one) for one in own.T])
        rest = values - np.einsum("ktc,kt->tc", shapes, moved)
        between = (np.arange(HARMONICS) + 0.5)[:, None] * 2 * np.pi * turns
        density = np.mean(np.abs(np.exp(-1j * between) @ rest) ** 2 / len(turns), axis=0)
        square = dict(zip(recording.forces, density.tolist(), strict=True))
        noise = np.diag(inverse) * float(density.mean())
        power, lasting = _variances(own)
        return cls(
            beats,
            np.array([square.get(axis, np.nan) for axis in ("x", "z")]),
            tuple(np.maximum(power - noise, 0.0).tolist()),
            tuple(np.maximum(lasting - noise, 0.0).tolist()),
        )


def _variances(own: Float[Array, "B K"]) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Return the variance [K] of ``own`` [B, K], values of B beats, and that of the mean of many, times their number.

    With the taper of :mod:`wingfit.inference.noise.between_beats`.
    """
    count, about = len(own), own - own.mean(axis=0)
    power = (about**2).sum(axis=0)
    total, pairs = TAPER[0] * power, TAPER[0] * count
    for lag, weight in enumerate(TAPER[1:], 1):
        total = total + 2.0 * weight * (about[lag:] * about[:-lag]).sum(axis=0)
        pairs += 2.0 * weight * (count - lag)
    return power / (count - 1), np.maximum(total / count / (1.0 - pairs / count**2), 0.0)
