"""The noise that a plan expects: stated, seen in recordings, or a default."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wingfit.calibration.problem import compared
from wingfit.inference.noise.harmonic import harmonic_fit, whole_markers
from wingfit.inference.noise.mean_beat import fourier_basis
from wingfit.planning.spec import PlanSpec
from wingfit.records import Dataset, Recording
from wingfit.records.array_types import Array, Float

Source = Literal["stated", "recordings", "default"]
TRACKS_MM = 0.5  # of each coordinate: stereo cameras, and markers of a few millimetres (van der Grinten, 5.2)
TRACKS_CORRELATION = 0.6  # of successive frames: the filter of a tracker
FORCES_MN = 3.0  # white noise of the same density as the vibrations of a clamped vehicle at low frequencies
SCATTER = 0.015  # of the force from beat to beat
MEMORY = 0.3  # correlation of the scatter of successive beats
LEAST_BEATS = 6  # from which the scatter of a recording is measured
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
        source: of the deviation, and of the scatter.
    """

    deviation: Float[Array, " A"]
    correlation: float
    scatter: float
    memory: float
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


def noise_for(dataset: Dataset, recordings: Sequence[Recording], spec: PlanSpec) -> NoiseLevel:
    """Return the noise that ``spec`` states or, where it does not, that ``recordings`` show, or else the default."""
    recorded = [one for one in recordings if one.valid.any()]
    tracks = dataset.kind == "tracks"
    found = (_seen_tracks if tracks else _seen_forces)(recorded) if recorded else _default(tracks=tracks)
    stated = spec.noise_mm if tracks else spec.noise_mn
    if stated is not None:
        found = replace(found, deviation=np.full(len(found.deviation), 1e-3 * stated), source="stated")
    if spec.correlation is not None:
        found = replace(found, correlation=spec.correlation)
    if spec.scatter_percent is not None:
        found = replace(found, scatter=spec.scatter_percent / 100.0, source_of_scatter="stated")
    return found


def _default(*, tracks: bool) -> NoiseLevel:
    if tracks:
        return NoiseLevel(np.full(3, 1e-3 * TRACKS_MM), TRACKS_CORRELATION, 0.0, 0.0, "default")
    return NoiseLevel(np.full(2, 1e-3 * FORCES_MN), 0.0, SCATTER, MEMORY, "default")


def _seen_tracks(recordings: Sequence[Recording]) -> NoiseLevel:
    """Return the mean noise of ``recordings``: that of differences between beats."""
    square, lags = list[Array](), list[float]()
    for one in recordings:
        fit = harmonic_fit(one, whole_markers(one))
        square.append(np.mean((fit.noise**2).reshape(-1, 3)[fit.used[::3]], axis=0))
        lags.append(fit.lag1)
    correlation = float(np.clip(np.mean(lags), 0.0, 0.95))
    return NoiseLevel(np.sqrt(np.mean(square, axis=0)), correlation, 0.0, 0.0, "recordings")


def _seen_forces(recordings: Sequence[Recording]) -> NoiseLevel:
    """Return the noise of unfiltered ``recordings`` of forces: the scatter of their beats, and the rest."""
    found = [beats for one in recordings if (beats := _beats(one)) is not None]
    if not found:
        return _default(tracks=False)
    level = np.sqrt(np.mean([square for square, _, _ in found], axis=0))
    scatter, memory = (float(np.mean([one[k] for one in found])) for k in (1, 2))
    return NoiseLevel(level, 0.0, scatter, float(np.clip(memory, 0.0, 0.8)), "recordings", "recordings")


def _beats(recording: Recording) -> tuple[Array, float, float] | None:
    """Return the square of the noise [2] (N^2), the scatter, and its correlation; None for too few beats.

    The amplitude of each beat is that of its least-squares fit to the mean beat. The noise is the spectral density of
    the rest between the harmonics, times the samples per second.
    """
    fit = harmonic_fit(recording, compared(recording, recording.forces))
    turns = recording.condition.flap_frequency * recording.times
    number = np.floor(turns - turns[0] + 1e-9).astype(int)
    beats = int(np.floor(turns[-1] - turns[0] + 1e-6))
    if beats < LEAST_BEATS:
        return None
    values = np.where(recording.valid, recording.values, 0.0)
    steady = ~fit.trend
    mean = fourier_basis(2 * np.pi * turns, int(fit.order.max())) @ fit.coefficients[:, steady].T
    mean = np.where(recording.valid, mean, 0.0)
    amplitude = np.array([_ratio(values[number == k], mean[number == k]) for k in range(beats)])
    rest = values - mean * np.interp(turns - turns[0], np.arange(beats) + 0.5, amplitude)[:, None]
    between = (np.arange(HARMONICS) + 0.5)[:, None] * 2 * np.pi * turns
    power = np.abs(np.exp(-1j * between) @ rest) ** 2 / max(len(turns), 1)
    own = amplitude - amplitude.mean()
    spread = float(np.sqrt(own @ own / (beats - 1)))
    lag = float(own[1:] @ own[:-1] / max(own @ own, 1e-300)) + 1.0 / beats
    deviation = np.mean(power, axis=0)
    return (
        np.array([deviation[recording.forces.index(a)] if a in recording.forces else np.nan for a in "xz"]),
        (spread),
        lag,
    )


def _ratio(values: Array, mean: Array) -> float:
    return float(np.sum(values * mean) / max(float(np.sum(mean**2)), 1e-300))
