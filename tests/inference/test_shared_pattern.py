"""A motion that all markers share, and noise of single markers, of any colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from wingfit.diagnosis.policy import POLICY
from wingfit.inference.noise.shared_pattern import shared_part
from wingfit.records.array_types import Array, Mask

FRAMES, MARKERS = 70, 40
X, Y = np.random.default_rng(3).uniform([[0.0], [0.0]], [[0.2], [0.5]], (2, MARKERS))
ANGLE = 0.5 * np.cos(np.linspace(0.0, 4 * np.pi, FRAMES))[:, None]
POSITIONS = np.stack([X + 0.0 * ANGLE, Y * np.cos(ANGLE), Y * np.sin(ANGLE)], axis=2).reshape(FRAMES, -1)


def noise(seed: int, memory: float) -> Array:
    white = np.random.default_rng(seed).standard_normal((FRAMES + 200, 3 * MARKERS))
    return np.asarray(lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], white, axis=0)[200:])


def part(scatter: Array, valid: Mask | None = None) -> float:
    known = np.ones(scatter.shape, bool) if valid is None else valid
    return shared_part(np.where(known, scatter, np.nan), known, np.where(known, POSITIONS[: len(scatter)], np.nan))


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_noise_of_single_markers_is_not_shared_even_if_a_camera_shakes(memory: float) -> None:
    for seed in range(50):
        assert part(noise(seed, memory) + np.tile(2.0 * noise(seed + 100, memory)[:, :3], MARKERS)) == 0.0


@pytest.mark.parametrize("share", [0.15, 0.3, 0.7])
def test_a_wing_that_bends_differently_in_every_beat_is_found_with_its_part_of_the_power_and_with_gaps(
    share: float,
) -> None:
    """The change grows as the square of the span, as bending does."""
    bent = np.zeros((FRAMES, MARKERS, 3))
    bent[:, :, 2] = noise(7, 0.9)[:, :1] * Y**2
    bent -= bent.mean(axis=1, keepdims=True)
    bent *= np.sqrt(share / (1.0 - share) / np.mean(bent**2))
    valid = np.repeat(np.random.default_rng(2).uniform(size=(FRAMES, MARKERS)) > 0.05, 3, axis=1)
    found = [part(bent.reshape(FRAMES, -1) + noise(seed, 0.5), valid) for seed in range(10)]
    assert min(found) > POLICY.shared
    assert np.mean(found) == pytest.approx(share, abs=0.04)


def test_a_change_much_smaller_than_the_noise_is_not_seen() -> None:
    small = np.zeros((FRAMES, MARKERS, 3))
    small[:, :, 2] = 0.3 * np.sign(ANGLE) * Y / 0.5
    assert part(small.reshape(FRAMES, -1) + noise(1, 0.5)) < POLICY.shared


def test_few_markers_or_frames_show_nothing() -> None:
    same = POSITIONS - POSITIONS.mean(axis=0)
    assert part(same) > 0.5
    assert shared_part(same[:, :33], np.ones((FRAMES, 33), bool), POSITIONS[:, :33]) == 0.0
    assert part(same[:29]) == 0.0
    assert part(np.zeros(same.shape)) == 0.0
    rarely = np.repeat(np.random.default_rng(2).uniform(size=(FRAMES, MARKERS)) > 0.8, 3, axis=1)
    assert part(same, rarely) == 0.0


@pytest.mark.parametrize("vibration_hz", [7.3, 37.3, 101.0])
def test_a_vibration_under_a_strobe_is_found_whatever_its_apparent_frequency(vibration_hz: float) -> None:
    """A frame of every beat of 3 Hz, 27/28 of a beat later: the vibration is in the frames at an alias."""
    times = np.arange(FRAMES) * 27.0 / 28.0 / 3.0
    bent = np.zeros((FRAMES, MARKERS, 3))
    bent[:, :, 2] = np.sin(2.0 * np.pi * vibration_hz * times)[:, None] * Y**2
    bent -= bent.mean(axis=1, keepdims=True)
    bent *= np.sqrt(1.0 / np.mean(bent**2))  # as large as the noise
    assert part(bent.reshape(FRAMES, -1) + noise(5, 0.0)) > 0.3
