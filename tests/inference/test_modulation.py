"""Odd and even beats that differ are found, are not taken for noise, and are not seen in noise of any colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.inference.test_harmonic import CONDITION, noise
from wingfit.inference.noise.changes.modulation import Modulation
from wingfit.inference.noise.changes.slow_change import Change
from wingfit.inference.noise.harmonic import harmonic_fit
from wingfit.records import Recording

Array = npt.NDArray[np.float64]
SIGMA = 5e-4  # m


def recording(values: Array, whole: int) -> Recording:
    """Tracks of 30 frames an apparent beat; between two frames are as many ``whole`` beats, and a thirtieth."""
    times = np.asarray(np.arange(len(values)) * (whole + 1.0 / 30.0) / CONDITION.flap_frequency, np.float64)
    return Recording(
        "r", "vacuum_chamber", CONDITION, times, tuple(f"m{k}" for k in range(values.shape[1] // 3)), values
    )


def alternating(
    beats: int, change: float, seed: int = 1, *, memory: float = 0.6, channels: int = 30, whole: int = 0
) -> Recording:
    """Tracks whose odd beats are larger than the mean by the fraction ``change``, and whose even ones are smaller."""
    psi, wave = steady(beats, channels, whole)
    sizes = 1.0 + change * np.sign(np.sin(psi / 2.0))
    return recording(wave * sizes[:, None] + SIGMA * noise(len(psi), memory, seed, channels), whole)


def steady(beats: int, channels: int = 30, whole: int = 0) -> tuple[Array, Array]:
    """Phase [T] (rad), and motion [T, C] with 10 to 20 mm of the first harmonic."""
    psi = 2.0 * np.pi * CONDITION.flap_frequency * recording(np.zeros((30 * beats, 3)), whole).times
    size = np.linspace(0.01, 0.02, channels)
    return psi, np.cos(psi)[:, None] * size + 0.2 * size * np.sin(2.0 * psi)[:, None]


@pytest.mark.parametrize("beats", [8, 9, 16])
@pytest.mark.parametrize("whole", [0, 1])
def test_a_difference_of_odd_and_even_beats_is_found_with_its_size(beats: int, whole: int) -> None:
    found = harmonic_fit(alternating(beats, 0.1, whole=whole)).modulation
    assert found is not None
    assert found.found
    motion = float(np.sqrt(np.mean(steady(beats)[1] ** 2)))
    assert found.size == pytest.approx(0.1 * motion, rel=0.25), "lines beside the first harmonic have most of it"


@pytest.mark.parametrize("whole", [0, 1])
def test_the_noise_is_that_of_beats_that_do_not_alternate(whole: int) -> None:
    alike, different = (harmonic_fit(alternating(8, change, whole=whole)) for change in (0.0, 0.1))
    assert not alike.drift or not alike.drift.found
    assert not different.drift or not different.drift.found
    low = alike.order <= 1
    np.testing.assert_allclose(different.variance[:, low].mean(), alike.variance[:, low].mean(), rtol=0.3)


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.98])
@pytest.mark.parametrize("beats", [4, 10])
def test_noise_of_any_colour_is_no_alternation(memory: float, beats: int) -> None:
    for seed in range(10):
        found = harmonic_fit(alternating(beats, 0.0, seed, memory=memory)).modulation
        assert found is not None
        assert not found.found


@pytest.mark.parametrize("beats", [4, 5, 6, 10])
@pytest.mark.parametrize("channels", [3, 30])
def test_beats_that_scatter_in_size_do_not_alternate(beats: int, channels: int) -> None:
    (psi, wave), alternate = steady(beats, channels), 0
    for seed in range(50):
        sizes = 1.0 + 0.05 * np.random.default_rng(seed).standard_normal(beats + 1)
        beat = (psi / (2.0 * np.pi) + 1e-9).astype(int)
        values = wave * sizes[beat][:, None] + 0.2 * SIGMA * noise(len(psi), 0.0, seed, channels)
        found = harmonic_fit(recording(values, 0)).modulation
        assert found is not None
        alternate += found.found
    assert alternate == 0


@pytest.mark.parametrize("samples", [7.5, 10.5, 12.5])
def test_high_harmonics_of_a_steady_force_are_no_alternation(samples: float) -> None:
    """With so few samples in a beat they appear half-way between the low ones."""
    frequency = CONDITION.flap_frequency
    times = np.asarray(np.arange(200) / samples / frequency, np.float64)
    psi = 2.0 * np.pi * frequency * times
    k = np.arange(1, 14)
    force = (0.1 / k * np.cos(k * psi[:, None] + k)).sum(axis=1)[:, None] * np.array([1.0, 0.5])
    values = force + 1e-4 * noise(200, 0.3, 1, 2)
    found = harmonic_fit(Recording("r", "wind_tunnel", CONDITION, times, (), values, forces=("x", "z"))).modulation
    assert found is None or not found.found


def test_it_is_found_beside_a_drift_and_with_gaps() -> None:
    one = alternating(16, 0.1)
    growing = 1.0 + 0.4 * np.linspace(-0.5, 0.5, len(one.times))[:, None]
    values = one.values * growing
    values[40:70, :15] = np.nan
    found = harmonic_fit(replace(one, values=values))
    assert found.modulation is not None
    assert found.drift is not None
    assert found.modulation.found
    assert found.drift.found


def test_slow_noise_of_the_mean_is_as_large_without_the_lines() -> None:
    """What is removed half-way between the harmonics says nothing of the noise at frequency zero."""
    alike, different = (harmonic_fit(alternating(10, change, memory=0.95)) for change in (0.0, 0.2))
    assert different.modulation is not None
    assert different.modulation.found
    mean = alike.order == 0
    np.testing.assert_allclose(different.variance[:, mean].mean(), alike.variance[:, mean].mean(), rtol=0.4)


def test_a_hum_at_one_line_is_no_alternation() -> None:
    psi, wave = steady(10)
    hum = 2e-3 * np.cos(2.5 * psi)[:, None]
    found = harmonic_fit(recording(wave + hum + SIGMA * noise(300, 0.3, 1, 30), 0)).modulation
    assert found is not None
    assert not found.found


def test_three_beats_are_too_few() -> None:
    assert harmonic_fit(alternating(3, 0.1)).modulation is None


@pytest.mark.parametrize("rate", [1.0 / 3.0, 0.29, 0.16])
def test_a_modulation_is_found_with_its_rate_and_is_no_noise(rate: float) -> None:
    psi, wave = steady(14)
    changing = wave * (1.0 + 0.15 * np.cos(rate * psi + 1.0))[:, None]
    found = harmonic_fit(recording(changing + SIGMA * noise(len(psi), 0.6, 1, 30), 0))
    assert found.modulation is not None
    assert found.modulation.found
    assert found.modulation.rate == pytest.approx(rate, abs=0.1 / 14)
    assert np.sqrt(np.mean(found.noise**2)) == pytest.approx(SIGMA, rel=0.1)


@pytest.mark.parametrize(
    ("rate", "words"), [(0.5, "every 2 beats"), (0.334, "every 3 beats"), (0.29, "at 0.29 of the")]
)
def test_the_rate_of_a_modulation_in_words(rate: float, words: str) -> None:
    assert Modulation(Change(30.0, 1e-9, 1e-3), rate).words("1 mm").startswith(f"{words}")
