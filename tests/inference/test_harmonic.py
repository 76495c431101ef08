"""Coefficients of the beat: exact on periodic signals, their noise known whatever its colour, gaps and beats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.inference.noise.harmonic import HARMONICS, harmonic_fit, still_markers
from wingfit.records import Condition, LowPass, Recording

CONDITION = Condition(3.0, 0.0, 101_325.0, 293.15)
MARKERS = 30


def recording(values: npt.NDArray[np.float64], frames_per_beat: int = 30) -> Recording:
    """Strobed tracks: each frame is of another beat."""
    times = np.arange(len(values)) * (frames_per_beat + 1) / (frames_per_beat * CONDITION.flap_frequency)
    names = tuple(f"m{k}" for k in range(values.shape[1] // 3))
    return Recording("r", "vacuum_chamber", CONDITION, times, names, values)


def noise(frames: int, memory: float, seed: int, channels: int = 3 * MARKERS) -> npt.NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    white, out = rng.standard_normal((frames, channels)), np.empty((frames, channels))
    out[0] = white[0]
    for t in range(1, frames):
        out[t] = memory * out[t - 1] + np.sqrt(1 - memory**2) * white[t]
    return out


@pytest.mark.parametrize("beats", [2, 4])
def test_a_periodic_signal_is_told_exactly_and_has_no_noise(beats: int) -> None:
    frames = 30 * beats
    psi = 2 * np.pi * CONDITION.flap_frequency * recording(np.zeros((frames, 3))).times
    wave = 0.1 + 0.02 * np.cos(psi) - 0.03 * np.sin(3 * psi)
    view = harmonic_fit(recording(np.stack([wave, wave, 2 * wave], axis=1)))
    assert view.between_beats
    told = dict(zip(zip(view.order.tolist(), range(len(view.order)), strict=True), view.coefficients[0], strict=True))
    assert told[(0, 0)] == pytest.approx(0.1)
    assert view.coefficients[0, 1] == pytest.approx(0.02)
    assert view.coefficients[2, HARMONICS + 3] == pytest.approx(-0.06)
    assert view.noise.max() < 1e-12


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("beats", [2, 3, 4])
def test_the_noise_of_every_coefficient_is_known(memory: float, beats: int) -> None:
    """Mean squares over the estimated variances are within a quarter of 1 up to the third harmonic."""
    ratios, level = [], []
    for seed in range(8):
        view = harmonic_fit(recording(5e-4 * noise(31 * beats, memory, seed)))
        ratios.append((view.coefficients**2 / view.variance).mean(axis=0))
        level.append(view.noise.mean())
    ratio = np.mean(ratios, axis=0)
    low = (view.order <= 3) & ~view.trend
    assert np.all(np.abs(ratio[low] - 1.0) < (0.25 if memory < 0.9 else 0.6))
    assert ratio.mean() == pytest.approx(1.0, abs=0.2)
    assert np.mean(level) == pytest.approx(5e-4, rel=0.08)


def test_gaps_and_lost_markers_bias_nothing() -> None:
    rng = np.random.default_rng(3)
    values = 5e-4 * noise(124, 0.6, 1)
    values[rng.uniform(size=(124, MARKERS)).repeat(3, axis=1) < 0.1] = np.nan
    values[:, :3] = np.nan
    view = harmonic_fit(recording(values))
    assert not view.used[:3].any()
    assert view.used[3:].all()
    ratio = (view.coefficients[3:] ** 2 / view.variance[3:]).mean()
    assert ratio == pytest.approx(1.0, abs=0.15)


def test_a_drift_is_seen_as_a_trend_and_not_as_a_harmonic() -> None:
    values = np.linspace(-1e-3, 1e-3, 124)[:, None] * np.ones(3) + 1e-5 * noise(124, 0.0, 2, 3)
    view = harmonic_fit(recording(values))
    assert view.coefficients[0, -3] == pytest.approx(1e-3, rel=0.02)
    assert np.abs(view.coefficients[0, :-3]).max() < 5e-5


def test_a_single_beat_tells_its_noise_only_by_what_is_left() -> None:
    view = harmonic_fit(recording(5e-4 * noise(31, 0.0, 4)))
    assert not view.between_beats
    assert view.noise.mean() == pytest.approx(5e-4, rel=0.15)
    assert not view.trend.any()


def test_a_low_pass_limits_what_is_looked_at() -> None:
    times = np.arange(800) / 800.0
    values = np.sin(2 * np.pi * 12.5 * times)[:, None]
    forces = Recording("f", "wind_tunnel", replace(CONDITION, flap_frequency=12.5), times, (), values, forces=("x",))
    assert harmonic_fit(forces).order.max() == 10
    assert harmonic_fit(replace(forces, low_pass=LowPass(40.0))).order.max() == 6


@pytest.mark.parametrize(
    ("frames", "per_beat", "message"),
    [(1, 30, "a diagnosis needs a beat"), (40, 1, "determine no harmonic"), (6, 30, "no harmonic|no channel")],
)
def test_what_tells_no_beat_is_refused_with_a_remedy(frames: int, per_beat: int, message: str) -> None:
    one = recording(noise(frames, 0.0, 1, 3))
    if per_beat == 1:  # every frame at the same phase
        one = replace(one, times=np.arange(frames) / CONDITION.flap_frequency)
    with pytest.raises(ValueError, match=message):
        harmonic_fit(one)


def test_a_recording_in_which_nothing_moves_is_refused_and_a_stuck_marker_is_not() -> None:
    values = np.tile([1.0, 0.0, 0.2, 0.0, 0.0, 0.0], (124, 1))
    with pytest.raises(ValueError, match=r"nothing moves, .* all 124 samples; check"):
        harmonic_fit(recording(values))
    values[:, :3] += noise(124, 0.5, 1, 3)
    found = harmonic_fit(recording(values))
    assert np.isfinite(found.variance).all()
    assert found.used.tolist() == [True] * 3 + [False] * 3, "a marker that never moves was not tracked"
    assert still_markers(recording(values)) == ("m1",)


def test_a_marker_that_was_never_seen_is_not_one_that_stands_still() -> None:
    values = np.concatenate([noise(124, 0.5, 1, 3), np.full((124, 3), np.nan)], axis=1)
    assert still_markers(recording(values)) == ()


def test_forces_have_no_markers_that_stand_still() -> None:
    one = replace(recording(noise(124, 0.5, 1, 3)), markers=(), values=np.zeros((124, 2)), forces=("x", "z"))
    assert still_markers(one) == ()


def test_no_recording_is_refused() -> None:
    with pytest.raises(ValueError, match="no recording to diagnose"):
        WhitenedData.of([])


def test_excess_is_what_is_there_beyond_the_noise() -> None:
    psi = 2 * np.pi * CONDITION.flap_frequency * recording(np.zeros((124, 3))).times
    misfit = 1e-3 * np.cos(psi)[:, None] * np.ones(3 * MARKERS)
    data = WhitenedData.of([recording(5e-4 * noise(124, 0.5, seed)) for seed in (5, 6)])
    found = data.coefficients_of([misfit, misfit])
    assert data.excess(found) == pytest.approx(0.5e-6 - data.weight @ data.variance, rel=0.05)
    assert data.noise == pytest.approx(5e-4, rel=0.08)
    assert data.recording_weights.sum() == pytest.approx(1.0)
    quiet = np.array(
        [
            data.excess(data.coefficients_of([5e-4 * noise(124, 0.5, s), 5e-4 * noise(124, 0.5, s + 1)]))
            for s in range(10, 30, 2)
        ]
    )
    assert np.std(quiet) < 4 * data.excess_standard_error
    assert abs(np.mean(quiet)) < 0.2 * data.noise**2
