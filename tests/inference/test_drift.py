"""A slow change of the beat is found, is not taken for noise, and is not seen in noise of any colour."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.inference.test_harmonic import CONDITION, noise, recording
from wingfit.inference.noise.harmonic import harmonic_fit
from wingfit.records import Recording

Array = npt.NDArray[np.float64]
SIGMA = 5e-4  # m


def waving(beats: int, change: float, seed: int, *, memory: float = 0.6, channels: int = 30) -> Recording:
    """Tracks whose amplitude, 10 to 20 mm in each channel, grows linearly by the fraction ``change``."""
    frames = 31 * beats
    psi = 2 * np.pi * CONDITION.flap_frequency * recording(np.zeros((frames, 3))).times
    size = np.linspace(0.01, 0.02, channels)
    growing = 1.0 + change * np.linspace(-0.5, 0.5, frames)
    wave = (growing * np.cos(psi))[:, None] * size + 0.2 * size * np.sin(2 * psi)[:, None]
    return recording(wave + SIGMA * noise(frames, memory, seed, channels))


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("beats", [3, 4, 8])
def test_noise_of_any_colour_is_no_drift(memory: float, beats: int) -> None:
    seen = [harmonic_fit(waving(beats, 0.0, seed, memory=memory)).drift for seed in range(30)]
    assert not [one for one in seen if one is None or one.found]


@pytest.mark.parametrize("beats", [4, 8, 20])
def test_noise_that_all_markers_share_is_no_drift(beats: int) -> None:
    """Its channels are not independent, so chance produces larger ratios."""
    for seed in range(40):
        common = waving(beats, 0.0, seed, channels=3)
        values = np.repeat(common.values, 10, axis=1) + 1e-6 * noise(len(common.values), 0.0, seed)[:, :30]
        drift = harmonic_fit(recording(values)).drift
        assert drift is not None
        assert not drift.found


@pytest.mark.parametrize("beats", [4, 8])
def test_a_change_of_amplitude_is_found_with_its_size(beats: int) -> None:
    drift = harmonic_fit(waving(beats, 0.2, 1)).drift
    assert drift is not None
    assert drift.found
    expected = 0.2 * np.sqrt(np.mean(np.linspace(0.01, 0.02, 30) ** 2) / 24.0)  # rms of a ramp times a cosine
    assert drift.size == pytest.approx(expected, rel=0.3)


def test_it_is_found_with_gaps_and_in_three_channels() -> None:
    given = waving(8, 0.2, 1, channels=3)
    gappy = given.values.copy()
    gappy[np.random.default_rng(0).random(len(gappy)) < 0.1] = np.nan
    drift = harmonic_fit(recording(gappy)).drift
    assert drift is not None
    assert drift.found


@pytest.mark.parametrize("beats", [4, 8])
def test_it_is_not_taken_for_noise(beats: int) -> None:
    steady, drifting = (harmonic_fit(waving(beats, change, 1)) for change in (0.0, 0.3))
    assert np.median(drifting.noise / steady.noise) == pytest.approx(1.0, abs=0.2)
    first = (drifting.order == 1) & drifting.trend
    excess = drifting.coefficients[:, first] ** 2 / drifting.variance[:, first]
    assert excess.sum(axis=1).mean() > 20.0, "the trends show it beside small noise"


def test_two_beats_do_not_show_it() -> None:
    assert harmonic_fit(waving(2, 0.2, 1)).drift is None


@pytest.mark.parametrize("still", [0, 1])
def test_a_recording_without_noise_has_no_drift(still: int) -> None:
    """Also where the scatter is exactly zero."""
    given = waving(4, 0.0, 1, channels=3)
    quiet = given.values - SIGMA * noise(len(given.values), 0.6, 1, 3)
    if still:
        quiet[:, 3 - 2 * still :] = 0.0
    drift = harmonic_fit(recording(quiet)).drift
    assert drift is not None
    assert drift.size < 1e-12
