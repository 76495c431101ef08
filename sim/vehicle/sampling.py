"""From a periodic beat to the samples of a recording, low-passed like it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wingfit.records import Recording
from wingfit.records.array_types import Array, Index
from wingfit.sim.filtering import gain, low_passed, sampling_rate

_NEGLIGIBLE = 1e-9  # of the largest: harmonics below are left out


def series_of(forces: Array, harmonics: int, recording: Recording) -> Array:
    """Series [..., 2 K + 1] of periodic ``forces`` [..., n], filtered like the recording; K are its ``harmonics``.

    Mean, then cosine and sine coefficients of each harmonic.
    """
    spectrum = np.fft.rfft(forces)[..., : harmonics + 1] / forces.shape[-1]
    if recording.low_pass:
        frequency = np.arange(harmonics + 1) * recording.condition.flap_frequency
        spectrum = spectrum * gain(recording.low_pass, sampling_rate(recording), frequency)
    spectrum[..., 1:] *= 2
    return np.concatenate([spectrum.real, -spectrum.imag[..., 1:]], axis=-1)


def passing(recording: Recording, harmonics: int) -> Index:
    """Index in such a series of the harmonics up to the last that the recording's low-pass lets through."""
    k = np.arange(harmonics + 1)
    if recording.low_pass:
        rate = sampling_rate(recording)
        passed = gain(recording.low_pass, rate, k * recording.condition.flap_frequency) > _NEGLIGIBLE
        k = k[: int(np.flatnonzero(passed)[-1]) + 1]
    return np.concatenate([k, harmonics + k[1:]])


def phases(recording: Recording, times: Array) -> Array:
    """Phase (rad) of the beat at ``times`` (s)."""
    return np.asarray(2 * np.pi * recording.condition.flap_frequency * times)


def turns(places: Index, harmonics: int, recording: Recording) -> Array:
    """Cosines, then sines [K, T] at ``places`` of a series, at the recording's instants."""
    psi = phases(recording, recording.times)
    cosines, sines = places[places <= harmonics], places[places > harmonics] - harmonics
    return np.concatenate([np.cos(cosines[:, None] * psi), np.sin(sines[:, None] * psi)])


def passed(added: Array, recording: Recording) -> Array:
    """What a balance ``added`` [T, C] to a recording, after the recording's low-pass.

    The low-pass leaves no value near the ends of a recording, where nothing is compared: there it stays as added.
    """
    if recording.low_pass is None or not added.any():
        return added
    values = low_passed(replace(recording, values=added, low_pass=None), recording.low_pass).values
    return np.where(np.isfinite(values), values, added)
