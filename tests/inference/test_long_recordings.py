"""Time and memory for the noise of long recordings are bounded, and the numbers are those of all spectral lines."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from tests.inference.test_harmonic import noise, recording
from wingfit.inference.noise import spectrum
from wingfit.inference.noise.changes.drift import drift_of
from wingfit.inference.noise.harmonic import changes_and_noise, harmonic_fit
from wingfit.inference.noise.mean_beat import masks_of


def density(beats: int, frames: int = 20) -> tuple[np.ndarray, np.ndarray]:
    values, number = noise(frames * beats, 0.6, 1, 2), np.arange(frames * beats)
    return spectrum.density_at_harmonics(values, np.ones_like(values, bool), 1.0 / frames, number, 4, beats)


def test_the_density_of_many_beats_needs_little_memory() -> None:
    tracemalloc.start()
    found, _ = density(1000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 300e6, "all lines at once need 1.6 GB"
    assert found[1:] == pytest.approx(density(60)[0][1:], rel=0.5)


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = density(40)
    monkeypatch.setattr(spectrum, "BLOCK", 10_000)
    for one, other in zip(whole, density(40), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_up_to_64_beats_all_lines_count(monkeypatch: pytest.MonkeyPatch) -> None:
    found = density(64)
    monkeypatch.setattr(spectrum, "MOST_LINES", 10_000)
    np.testing.assert_array_equal(found[0], density(64)[0])


def test_the_drift_of_many_samples_takes_no_time_that_grows_with_their_square() -> None:
    """Columns of 100 000 samples are compared as bytes: as fields of a record they take minutes."""
    frames, beats = 100, 1000
    values, time = noise(frames * beats, 0.0, 1, 2), np.arange(frames * beats) / frames
    assert drift_of(values, np.ones_like(values, bool), 2 * np.pi * time, time, 2, beats) is not None


def test_masks_come_with_their_channels_in_the_order_of_their_values() -> None:
    valid = np.array([[True, False, True, True], [True, True, False, True]])
    masks, group = np.unique(valid, axis=1, return_inverse=True)
    found = masks_of(valid)
    np.testing.assert_array_equal([mask for mask, _ in found], masks.T)
    assert [channels.tolist() for _, channels in found] == [
        np.flatnonzero(group.ravel() == k).tolist() for k in range(3)
    ]


def test_changes_and_noise_alone_are_those_of_the_fit() -> None:
    one = recording(5e-4 * noise(31 * 8, 0.6, 1, 6))
    one = replace(one, values=one.values + 0.01 * np.cos(2 * np.pi * one.condition.flap_frequency * one.times)[:, None])
    fit, (drift, modulation, level) = harmonic_fit(one), changes_and_noise(one)
    assert drift == fit.drift
    assert modulation == fit.modulation
    assert level == pytest.approx(float(np.sqrt(np.mean(fit.noise[fit.used] ** 2))))
