"""Samples of a recording from a periodic beat, with the recording's low-pass."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from wingfit.records import Recording
from wingfit.records.array_types import Array, Index
from wingfit.sim.filtering import gain, low_passed, sampling_rate

_NEGLIGIBLE = 1e-9  # gain below which a harmonic is omitted


def series_of(forces: Array, harmonics: int, recording: Recording) -> Array:
    """Fourier series [..., 2 K + 1] of periodic ``forces`` [..., n], filtered like the recording; K is ``harmonics``.

    Mean, then K cosine coefficients, then K sine coefficients.
    """
    spectrum = np.fft.rfft(forces)[..., : harmonics + 1] / forces.shape[-1]
    if recording.low_pass:
        frequency = np.arange(harmonics + 1) * recording.condition.flap_frequency
        spectrum = spectrum * gain(recording.low_pass, sampling_rate(recording), frequency)
    spectrum[..., 1:] *= 2
    return np.concatenate([spectrum.real, -spectrum.imag[..., 1:]], axis=-1)


def phases(recording: Recording, times: Array) -> Array:
    """Phase (rad) of the beat at ``times`` (s)."""
    return np.asarray(2 * np.pi * recording.condition.flap_frequency * times)


@lru_cache(maxsize=1)  # of the last recording only, since those of long recordings are large
def basis_of(recording: Recording, harmonics: int) -> tuple[Array, Index]:
    """Cosines, then sines of the harmonics that the recording's low-pass passes, at its T instants: array [K, T].

    The second array [K] holds the index of each of these rows in the coefficients of :func:`series_of`.
    """
    k = np.arange(harmonics + 1)
    if recording.low_pass:
        rate = sampling_rate(recording)
        passed = gain(recording.low_pass, rate, k * recording.condition.flap_frequency) > _NEGLIGIBLE
        k = k[: int(np.flatnonzero(passed)[-1]) + 1]
    angles = k[:, None] * phases(recording, recording.times)
    return np.concatenate([np.cos(angles), np.sin(angles[1:])]), np.concatenate([k, harmonics + k[1:]])


def passed(added: Array, recording: Recording) -> Array:
    """Forces ``added`` [T, C] (N), errors that the balance adds, after the recording's low-pass.

    Near the ends of a recording, where the low-pass gives no values and nothing is compared, they are unfiltered.
    """
    if recording.low_pass is None or not added.any():
        return added
    values = low_passed(replace(recording, values=added, low_pass=None), recording.low_pass).values
    return np.where(np.isfinite(values), values, added)
