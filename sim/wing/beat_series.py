"""Fourier series of simulated tracks over a beat, and their values at the frames of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Complex, Index

MAX_SHIFT = 0.05  # rad, about 3 degrees of the beat
_GRID = 96  # instants of a beat at which effects of the observation act
_HARMONICS = 30  # of the periodic tracks; higher ones are below the integrator's error


def distinct(rows: Array) -> tuple[Index, Index]:
    """Indices of the distinct ``rows``, and for every row the position of its equal among these (bit for bit)."""
    first = dict[bytes, int]()
    kinds = [first.setdefault(row.tobytes(), len(first)) for row in rows]
    return np.unique(kinds, return_index=True)[1], np.array(kinds, np.intp)


@dataclass(frozen=True)
class SlowChange:
    """Change of a beat during a recording of T frames, relative to the beat in its middle.

    ``elapsed`` [T]: part of the recording that has passed, from -1/2 to 1/2; ``linear``, ``curved`` [K + 1, C]: series
    that are multiplied by it and by its square.
    """

    elapsed: Array
    linear: Complex
    curved: Complex

    @classmethod
    def through(cls, early: Complex, middle: Complex, late: Complex, times: Array) -> SlowChange:
        """Return the parabola through the series [K + 1, C] at the start, the middle and the end of ``times`` [T]."""
        length = times[-1] - times[0]
        elapsed = (times - times[0]) / length - 0.5 if length > 0 else np.zeros(len(times))
        return cls(elapsed, late - early, 2.0 * (early + late - 2.0 * middle))

    def values(self, waves: Array, phase: float) -> Array:
        """Values [T, C] of the change, advanced in phase by ``phase`` (rad); ``waves``: see :func:`_fitted`."""
        u = self.elapsed[:, None]
        linear, curved = (waves @ _parts(_turned(series, phase)) for series in (self.linear, self.curved))
        return np.asarray(u * linear + u * u * curved)


def on_grid(tracks: Array) -> Array:
    """Resample periodic ``tracks`` [n, M, 3] at _GRID equal steps, from their first _HARMONICS harmonics."""
    series = series_of(tracks.reshape(len(tracks), -1))
    series[1:] *= 0.5
    return np.asarray(np.fft.irfft(series * _GRID, _GRID, axis=0)).reshape(_GRID, *tracks.shape[1:])


def aligned_values(
    series: Complex, since: Array, own: Array, recorded: Array, changes: Mapping[int, SlowChange]
) -> Array:
    """Values [B, T, C] of the Fourier ``series`` [B, K + 1, C] of B individuals at the frames of a recording.

    The phase (rad) at a frame is ``since`` [B, T], since the recorded crossing, plus ``own`` [B], the simulated
    crossing, plus a common shift of each individual. Two Gauss-Newton steps fit the shift to ``recorded`` [T, C]; noise
    makes a shift of about a thousandth of a radian. Each step is limited to MAX_SHIFT, so that a larger shift remains
    visible as misfit. The series is shifted, not the frames, so that individuals can share the sines and cosines of the
    frames. ``changes``: slow changes during the recording, by individual.
    """
    weight = np.isfinite(recorded).astype(float)
    target = np.where(np.isfinite(recorded), recorded, 0.0)
    first, which = distinct(since)
    angles = since[first, :, None] * np.arange(series.shape[1])
    waves = np.concatenate([np.cos(angles), np.sin(angles)], axis=2)
    found = np.empty((len(series), *recorded.shape))
    for b, (one, place, k) in enumerate(zip(series, own, which, strict=True)):
        turned, change = _turned(one, place), changes.get(b)
        if change is None:
            found[b] = waves[k] @ _parts(_fitted(waves[k], turned, target, weight)[0])
            continue
        shifted, shift = _fitted(waves[k], turned, target - change.values(waves[k], place), weight)
        found[b] = waves[k] @ _parts(shifted) + change.values(waves[k], place + shift)
    return found


def _fitted(waves: Array, series: Complex, target: Array, weight: Array) -> tuple[Complex, float]:
    """Shift ``series`` [K + 1, C] in phase to fit ``target`` [T, C] by weighted least squares; also returns the shift.

    ``weight`` [T, C]: 1 where recorded, 0 elsewhere. ``waves`` [T, 2 (K + 1)]: cosines, then sines, of k times the
    phase of each frame, k = 0 .. K.
    """
    order, whole = 1j * np.arange(len(series))[:, None], 0.0
    for _ in range(2):
        slope = weight * (waves @ _parts(order * series))
        power = float((slope * slope).sum())
        shift = -float((slope * (waves @ _parts(series) - target)).sum()) / power if power > 0 else 0.0
        shift = float(np.clip(shift, -MAX_SHIFT, MAX_SHIFT))
        series, whole = _turned(series, shift), whole + shift
    return series, whole


def _turned(series: Complex, phase: float) -> Complex:
    """Fourier ``series`` [K + 1, C] of the same functions, advanced in phase by ``phase`` (rad)."""
    return np.asarray(series * np.exp(1j * np.arange(len(series)) * phase)[:, None])


def _parts(series: Complex) -> Array:
    """Real coefficients [2 (K + 1), C] of ``series`` [K + 1, C]: of cosines, then of sines.

    Re s exp(i x) = Re s cos x - Im s sin x.
    """
    return np.concatenate([series.real, -series.imag])


def series_of(samples: Array) -> Complex:
    """Fourier series [_HARMONICS + 1, C] of periodic ``samples`` [n, C] over a beat.

    value(psi) = Re sum_k series_k exp(i k psi) at the drive phase psi.
    """
    n = len(samples)
    used = min(_HARMONICS, (n - 1) // 2) + 1
    series = np.zeros((_HARMONICS + 1, samples.shape[1]), np.complex128)
    series[:used] = np.fft.rfft(samples, axis=0)[:used] / n
    series[1:] *= 2
    return series
