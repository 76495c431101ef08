"""The result of a run over recordings whose beat drifts says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.calibration.test_search import SPEC, Here
from tests.calibration.wave_forces import F, recording
from wingfit.calibration.estimates.changing_beat import changing_beat_remarks
from wingfit.calibration.forces.estimation import summarise_forces
from wingfit.calibration.result import ADEQUATE, judge
from wingfit.calibration.search import CalibrationSpec, calibrate
from wingfit.records import Condition, Dataset, Genome, Recording

SAYS = "the beat changes slowly during "
NOISE = 2e-4  # m, N


def growing_tracks(change: float, seed: int = 1, noise: float = NOISE, beats: int = 8) -> Recording:
    """Two markers whose amplitude grows linearly by the fraction ``change``, 31 frames a beat."""
    times = np.arange(31 * beats) / 93.0
    growing = 1.0 + change * np.linspace(-0.5, 0.5, len(times))
    wave = (growing * np.cos(2 * np.pi * 3.0 * times))[:, None] * np.linspace(0.01, 0.02, 6)
    values = wave + noise * np.random.default_rng(seed).normal(size=wave.shape)
    return Recording("long", "wind_tunnel", Condition(3.0, 0.0, 1e5, 293.0), times, ("a", "b"), values)


def growing_forces(change: float, seed: int = 1) -> Recording:
    """X and Z of ten beats, of which X grows linearly by the fraction ``change``."""
    times = np.arange(800) / 1000.0
    growing = 1.0 + change * np.linspace(-0.5, 0.5, len(times))
    values = np.stack([0.1 * growing * np.cos(2 * np.pi * F * times), 0.1 * np.cos(2 * np.pi * F * times)], axis=1)
    return recording(values + NOISE * np.random.default_rng(seed).normal(size=values.shape))


def test_a_drift_of_tracks_or_forces_is_remarked_with_its_size() -> None:
    (remark,) = changing_beat_remarks([growing_tracks(0.0), growing_tracks(0.2)])
    assert remark.startswith(f"{SAYS}'long' (by 0.")
    assert " mm, " in remark
    assert "something drifts (a stiffness, a motor, a clock, a camera)" in remark
    (remark,) = changing_beat_remarks([growing_forces(0.2)], ("x",))
    assert " mN, " in remark
    assert changing_beat_remarks([growing_forces(0.2)], ("z",)) == (), "not compared"
    assert changing_beat_remarks([growing_forces(0.2)], ("x", "y")) == (), "not recorded"


def test_odd_and_even_beats_that_differ_are_remarked() -> None:
    one = growing_forces(0.0)
    odd = np.sign(np.sin(np.pi * F * one.times))[:, None]
    (remark,) = changing_beat_remarks([replace(one, values=one.values * (1.0 + 0.05 * odd))])
    assert remark.startswith(f"beats differ periodically in '{one.name}' (every 2 beats, by 3")
    assert "stated too high" in remark


@pytest.mark.parametrize("seed", range(5))
def test_a_steady_beat_is_not_remarked(seed: int) -> None:
    steady = growing_tracks(0.0, seed), growing_tracks(0.0, seed, noise=0.0), growing_forces(0.0, seed)
    assert changing_beat_remarks(steady) == ()


def test_a_change_far_below_the_noise_and_short_recordings_are_not_remarked() -> None:
    still = replace(growing_tracks(0.2), values=np.zeros((248, 6)))
    assert changing_beat_remarks([growing_tracks(1e-4), growing_tracks(0.2, beats=1), still]) == ()


def test_a_run_over_drifting_tracks_mentions_the_drift(small: tuple[Dataset, Genome]) -> None:
    """The misfit that the drift leaves is not blamed on the search and the model alone."""
    dataset, truth = small
    drifting = []
    for one in dataset.recordings:
        size, every = np.linspace(0.9, 1.1, 4 * len(one.times))[:, None], np.tile(one.values, (4, 1))
        period = len(one.times) * np.median(np.diff(one.times))
        times = np.concatenate([one.times + k * period for k in range(4)])
        noise = NOISE * np.random.default_rng(1).normal(size=every.shape)
        mean = np.nanmean(every, axis=0)
        drifting.append(replace(one, times=times, values=mean + size * (every - mean) + noise))
    result = judge(SPEC, replace(dataset, recordings=tuple(drifting)), Here(), truth.as_dict())
    (remark,) = [remark for remark in result.remarks if remark.startswith(SAYS)]
    assert all(repr(one.name) in remark for one in drifting)
    assert result.noise is not None
    assert result.after > ADEQUATE * result.noise
    assert "the beat drifts (see below), the search was cut short, or the model misses physics" in result.remarks[0]
    steady = judge(SPEC, dataset, Here(), truth.as_dict())
    assert not any("drift" in remark for remark in steady.remarks)


def test_a_run_over_drifting_forces_mentions_the_drift(forces: Dataset) -> None:
    def remarked(change: float) -> list[str]:
        size = 1.0 + change * np.linspace(-0.5, 0.5, 640)[:, None]
        moving = replace(forces, recordings=tuple(replace(r, values=size * r.values) for r in forces.recordings))
        spec = CalibrationSpec(mode="joint", max_generations=1)
        *_, last = calibrate(spec, moving, Here())
        found = summarise_forces(spec, moving, Here(), last.checkpoint)
        return [remark for remark in found.remarks if remark.startswith(SAYS)]

    assert remarked(0.0) == []
    (remark,) = remarked(0.3)
    assert "'test-0'" in remark
