"""The start of the beat: where the reference markers cross the height of the hinge on the upstroke (thesis IV-A).

Tracks are compared at equal phase of the beat, so the crossing must be known to a fraction of a frame: a phase error of
0.01 rad displaces the wing tip by millimetres. A Fourier series of a few harmonics is fitted to the heights of the
reference markers and averaged over the markers. Its crossing is the start of the beat, in recordings and in simulations
alike.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from wingfit.records import Recording, Wing
from wingfit.records.array_types import Array, Complex
from wingfit.records.blas_threads import one_blas_thread

REFERENCE_HARMONICS = 4
_NEWTON_STEPS = 30
_CACHE = WeakKeyDictionary[Recording, dict[tuple[tuple[str, ...], float], float]]()
"""Cached crossings of recordings, by the attributes of the wing on which they depend."""


def reference_columns(wing: Wing, recording: Recording) -> list[int]:
    """Indices, in ``recording.markers``, of the reference markers with enough samples to locate the start of a beat.

    For a recording without data, of all reference markers. ValueError if there are none.
    """
    needed = 2 * (2 * REFERENCE_HARMONICS + 1) if recording.valid.any() else 0
    found = [
        recording.markers.index(name)
        for name in wing.reference_markers
        if name in recording.markers
        and np.isfinite(recording.positions[:, recording.markers.index(name), 2]).sum() >= needed
    ]
    if not found:
        raise ValueError(
            f"recording {recording.name!r}: none of the reference markers ({', '.join(wing.reference_markers)}) has at "
            f"least {needed} tracked frames, so the start of the beat is unknown; name other reference_markers"
        )
    return found


@one_blas_thread
def recorded_crossing(wing: Wing, recording: Recording) -> float:
    """Phase 2 pi f t (rad) at which the reference markers of ``recording`` cross the hinge height on the upstroke.

    0 for a recording without data, which only describes what to simulate. ValueError if they never cross.
    """
    known, key = _CACHE.setdefault(recording, {}), (wing.reference_markers, wing.hinge.z)
    if key not in known:
        known[key] = _crossing(wing, recording) if recording.valid.any() else 0.0
    return known[key]


def _crossing(wing: Wing, recording: Recording) -> float:
    psi = 2 * np.pi * recording.condition.flap_frequency * recording.times
    k = np.arange(1, REFERENCE_HARMONICS + 1)
    basis = np.hstack([np.ones((len(psi), 1)), np.cos(psi[:, None] * k), -np.sin(psi[:, None] * k)])
    total = np.zeros(2 * REFERENCE_HARMONICS + 1)
    columns = reference_columns(wing, recording)
    for column in columns:
        z = recording.positions[:, column, 2]
        seen = np.isfinite(z)
        total += np.linalg.lstsq(basis[seen], z[seen], rcond=None)[0]
    total /= len(columns)
    series = np.concatenate([[total[0]], total[1 : 1 + len(k)] + 1j * total[1 + len(k) :]])
    crossing = upstroke_crossing(series[None], wing.hinge.z)[0]
    if not np.isfinite(crossing):
        raise ValueError(
            f"recording {recording.name!r}: the reference markers never cross the hinge height "
            f"({wing.hinge.z:g} m) on an upstroke; check the hinge position, the flap frequency and the time unit"
        )
    return float(crossing)


def upstroke_crossing(series: Complex, level: float) -> Array:
    """Phases psi [B] (rad) at which Re sum_k series[:, k] exp(i k psi) rises through ``level``; NaN where it does not.

    ``series`` [B, K + 1]. Newton's method is used, starting at the crossing of mean and first harmonic alone.
    """
    k = np.arange(series.shape[1])
    first = np.abs(series[:, 1])
    ratio = (level - series[:, 0].real) / np.where(first > 0, first, np.nan)
    with np.errstate(invalid="ignore"):
        psi = -np.arccos(ratio) - np.angle(series[:, 1])
        for _ in range(_NEWTON_STEPS):
            wave = series * np.exp(1j * k * psi[:, None])
            value, slope = wave.sum(axis=1).real - level, (1j * k * wave).sum(axis=1).real
            psi = psi - np.clip(value / slope, -0.3, 0.3)
        wave = series * np.exp(1j * k * psi[:, None])
        off = np.abs(wave.sum(axis=1).real - level) > 1e-9 * first
        falling = (1j * k * wave).sum(axis=1).real <= 0
    return np.where(off | falling, np.nan, psi)
