"""Noise that is one pattern of all markers, and noise of single markers, of any colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from wingfit.diagnosis.policy import POLICY
from wingfit.inference.noise.shared_pattern import shared_part
from wingfit.records.array_types import Array

FRAMES, MARKERS = 70, 40


def noise(seed: int, memory: float) -> Array:
    white = np.random.default_rng(seed).standard_normal((FRAMES + 200, 3 * MARKERS))
    return np.asarray(lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], white, axis=0)[200:])


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.8])
def test_noise_of_single_markers_has_no_pattern_even_if_a_camera_shakes(memory: float) -> None:
    for seed in range(20):
        shaken = noise(seed, memory) + np.tile(2.0 * noise(seed + 100, memory)[:, :3], MARKERS)
        assert shared_part(shaken, np.ones(shaken.shape, bool)) < POLICY.shared


def test_a_motion_that_changes_is_one_pattern_also_with_gaps() -> None:
    size = np.repeat(np.linspace(0.0, 1.0, MARKERS), 3) * np.tile([0.1, 0.2, 1.0], MARKERS)
    changing = np.cos(np.linspace(0.0, 4 * np.pi, FRAMES))[:, None] * size
    valid = np.repeat(np.random.default_rng(2).uniform(size=(FRAMES, MARKERS)) > 0.05, 3, axis=1)
    assert shared_part(np.where(valid, 12.0 * changing + noise(1, 0.5), np.nan), valid) > 0.5
    assert shared_part(np.where(valid, 2.0 * changing + noise(1, 0.5), np.nan), valid) < POLICY.shared


def test_few_markers_or_frames_show_no_pattern() -> None:
    same = np.ones((FRAMES, 30)) * np.arange(30)
    assert shared_part(same, np.ones(same.shape, bool)) == 0.0
    assert shared_part(noise(1, 0.0)[:40], np.ones((40, 120), bool)) == 0.0
    assert shared_part(np.zeros((60, 120)), np.ones((60, 120), bool)) == 0.0
