"""Low-passed forces of few beats: the filter has no transient at their ends, and their noise is estimated rightly."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.records import Condition, LowPass, Recording
from wingfit.sim.filtering import gain, low_passed

FREQUENCY, RATE, SENSOR = 11.3, 1000.0, 0.003
WAVES = np.array([[0.3, 0.5, 0.2, -0.1, 0.05], [0.1, -0.2, 0.4, 0.1, -0.08]])  # N along x and z, harmonics 0 to 4


def forces(beats: float, seed: int | None = None) -> Recording:
    times = np.arange(round(beats * RATE / FREQUENCY) + 1) / RATE
    values = beat(times, np.ones(WAVES.shape[1]))
    if seed is not None:
        values = values + SENSOR * np.random.default_rng(seed).standard_normal(values.shape)
    condition = Condition(flap_frequency=FREQUENCY, phase_lag=0.0, pressure=1e5, temperature=293.0)
    return Recording(f"r{seed}", "wind_tunnel", condition, times, (), values, forces=("x", "z"))


def beat(times: np.ndarray, kept: np.ndarray) -> np.ndarray:
    k = np.arange(WAVES.shape[1])
    return np.asarray((np.cos(2 * np.pi * FREQUENCY * times[:, None] * k + 0.7 * k) * kept) @ WAVES.T)


@pytest.mark.parametrize("beats", [1.0, 1.6, 2.0, 3.4, 7.9])
def test_a_beat_that_repeats_is_filtered_exactly_up_to_both_ends(beats: float) -> None:
    low_pass = LowPass(3.2 * FREQUENCY)
    one = forces(beats)
    kept = gain(low_pass, RATE, FREQUENCY * np.arange(WAVES.shape[1]))
    np.testing.assert_allclose(low_passed(one, low_pass).values, beat(one.times, kept), atol=1e-9)


@pytest.mark.parametrize("beats", [2.0, 2.5, 3.0, 4.0, 4.1, 7.0, 9.0])
def test_the_noise_is_that_of_the_filtered_sensor(beats: float) -> None:
    low_pass = LowPass(3.2 * FREQUENCY)
    passed = np.sqrt(np.mean(gain(low_pass, RATE, np.linspace(0.0, 0.5 * RATE, 4096)) ** 2))
    data = WhitenedData.of([low_passed(forces(beats, seed), low_pass) for seed in range(6)])
    assert 0.75 < data.noise / (SENSOR * passed) < 1.4
