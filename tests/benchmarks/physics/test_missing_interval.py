from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.physics.missing_interval import located, missing_interval
from tests.calibration.wave_forces import Array, waves
from wingfit.calibration.estimates.likelihood import estimate
from wingfit.calibration.forces.agreement import whole_beats
from wingfit.calibration.problem import Problem, base_genome
from wingfit.records import LowPass
from wingfit.sim.filtering import low_passed
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.virtual_rigs.balance import DRAG, TRIALS, Balance, delfly, record, true_beat
from wingfit.workers import make_evaluator


def bump(phase: Array, centre: float, width: float) -> Array:
    return np.asarray(0.05 * np.exp(-0.5 * (((phase - centre + 0.5) % 1 - 0.5) / width) ** 2))


@pytest.mark.parametrize("centre", [0.3, 0.98])
def test_misfit_is_located(centre: float) -> None:
    phase = np.arange(200) / 200
    found = located(waves(beats=12, noise=0.01), bump(phase, centre, 0.03))
    assert found is not None
    middle, length = (found[0] + found[1]) / 2 % 1, found[1] - found[0]
    assert middle == pytest.approx(centre, abs=0.01)
    assert length == pytest.approx(2 * 1.163 * 0.03, abs=0.015)  # 90 % of the square of a Gaussian, cut at both ends
    assert 0 <= found[0] < 1


def test_refitted_coefficients_do_not_carry_the_misfit_away() -> None:
    """A coefficient that acts everywhere is drawn to the missing force; the misfit is still where the force is."""
    phase = np.arange(200) / 200
    slope = 0.1 + bump(phase, 0.25, 0.1)[:, None]
    missing = -4 * bump(phase, 0.2, 0.05)
    residual = missing - slope @ np.linalg.lstsq(slope, missing, rcond=None)[0]
    noisy = waves(beats=12, noise=0.01)
    with_slope, without = located(noisy, residual, slope), located(noisy, residual)
    assert with_slope is not None
    assert without is not None
    assert with_slope[0] == pytest.approx(0.14, abs=0.03)
    assert with_slope[1] == pytest.approx(0.26, abs=0.03)
    assert without[1] - without[0] > 2 * (with_slope[1] - with_slope[0])


def test_noise_is_not_located() -> None:
    false_alarms = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noisy = waves(beats=12)
        slow = np.repeat(rng.standard_normal(24), 40)[:, None]  # two values a beat
        noisy = replace(noisy, values=noisy.values + 0.01 * slow + 0.005 * rng.standard_normal(noisy.values.shape))
        residual = whole_beats(waves(beats=12)).mean["x"] - whole_beats(noisy).mean["x"]
        false_alarms += located(noisy, residual) is not None
    assert false_alarms <= 3
    few = waves(beats=4, noise=0.01)
    assert located(few, bump(np.arange(200) / 200, 0.3, 0.03)) is None


@pytest.mark.parametrize(("left_out", "expected"), [((), False), (("clap_and_peel",), True)])
def test_missing_fling_is_found_where_the_wings_peel(left_out: tuple[str, ...], expected: bool) -> None:
    trial, vehicle = TRIALS[3], delfly()
    raw = record(true_beat(vehicle, trial), trial, Balance(every=10, beats=12), np.random.default_rng(0))
    low = low_passed(raw, LowPass(40.0))
    model = BladeElementWing(vehicle, chosen("proposed", left_out))
    problem = Problem(model, (low,), model.searched, base_genome(model, DRAG), ("x",))
    evaluator = make_evaluator("in_process")
    best = problem.base.replace(estimate(problem, evaluator, {}).values)
    place = missing_interval(replace(problem, base=best), evaluator)
    assert (place is not None) is expected
    if place is not None:
        assert 0 <= place[0] < 0.15
        assert 0.25 < place[1] < 0.4
