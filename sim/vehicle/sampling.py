"""Forces of a simulated periodic beat, sampled at the instants of a recording and low-passed like it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from wingfit.records import LowPass, Recording
from wingfit.records.array_types import Array, Index
from wingfit.sim.filtering import Filter, beat_harmonics, gain, sampling_rate
from wingfit.sim.kernels import LANES
from wingfit.sim.vehicle.elements import TOGETHER

_NEGLIGIBLE = 1e-9  # gain below which a harmonic is omitted
_LARGE = 2**18  # numbers; of larger bases and filters only the last one is cached


def series_of(forces: Array, harmonics: int, recording: Recording) -> Array:
    """Fourier series [..., 2 K + 1] of periodic ``forces`` [..., n], filtered like the recording; K is ``harmonics``.

    Its entries are the mean, then K cosine coefficients, then K sine coefficients, in the unit of ``forces``.
    """
    spectrum = np.fft.rfft(forces)[..., : harmonics + 1] / forces.shape[-1]
    if recording.low_pass:
        spectrum = spectrum * _gain_at_harmonics(recording, recording.low_pass, harmonics)
    spectrum[..., 1:] *= 2
    return np.concatenate([spectrum.real, -spectrum.imag[..., 1:]], axis=-1)


def phases(recording: Recording, times: Array) -> Array:
    """Phase 2 pi f t (rad) of the beat at ``times`` t (s), with the recording's flap frequency f."""
    return np.asarray(2 * np.pi * recording.condition.flap_frequency * times)


def basis_of(recording: Recording, harmonics: int) -> tuple[Array, Index]:
    """Cosines, then sines, of the harmonics that the recording's low-pass passes, at its T instants: [R, G, W].

    Each row is filled up with zeros to whole groups, as :func:`synthesise` needs it. The second array [R] holds the
    index of the coefficient of each of these R rows in the result of :func:`series_of`.
    """
    k = np.arange(harmonics + 1)
    if recording.low_pass:
        passed = _gain_at_harmonics(recording, recording.low_pass, harmonics) > _NEGLIGIBLE
        k = k[: int(np.flatnonzero(passed)[-1]) + 1]
    cached = _last_basis if 2 * len(k) * len(recording.times) > _LARGE else _recent_basis
    return cached(recording, len(k)), np.concatenate([k, harmonics + k[1:]])


def _basis(recording: Recording, count: int) -> Array:
    angles = np.arange(count)[:, None] * phases(recording, recording.times)
    basis, size = np.concatenate([np.cos(angles), np.sin(angles[1:])]), TOGETHER * LANES
    return np.pad(basis, ((0, 0), (0, -basis.shape[1] % size))).reshape(len(basis), -1, LANES)


# A search compares with one recording after the other, and again: without these, half of its time goes into cosines
# and gains.
_recent_basis = lru_cache(maxsize=16)(_basis)
_last_basis = lru_cache(maxsize=1)(_basis)


@lru_cache(maxsize=64)
def _gain_at_harmonics(recording: Recording, low_pass: LowPass, harmonics: int) -> Array:
    """Gain [K + 1] of ``low_pass`` at harmonics 0 to K of the flap frequency of ``recording``."""
    frequency = np.arange(harmonics + 1) * recording.condition.flap_frequency
    return gain(low_pass, sampling_rate(recording), frequency)


def passed(added: Array, recording: Recording) -> Array:
    """Errors ``added`` [T, C] (N) of a balance at the recording's T instants, filtered by the recording's low-pass.

    They stay unfiltered near the ends of a recording, where the low-pass gives no values, and wherever they are not all
    finite: then the forces are not either.
    """
    if recording.low_pass is None or not added.any() or not np.isfinite(added).all():
        return added
    size = (2 * beat_harmonics(recording, recording.low_pass) + 1) * len(recording.times)
    prepared = _last_filter if size > _LARGE else _recent_filter
    values = prepared(recording, recording.low_pass)(added)
    return np.where(np.isfinite(values), values, added)


_recent_filter = lru_cache(maxsize=16)(Filter.of)
_last_filter = lru_cache(maxsize=1)(Filter.of)
