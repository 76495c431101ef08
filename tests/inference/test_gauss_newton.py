"""The damped step on quadratics whose minimum is known, inside the box and at its faces."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.inference.gauss_newton import Quadratic, Trials

RNG = np.random.default_rng(2)
SLOPES, OFFSET = RNG.standard_normal((20, 3)), RNG.standard_normal(20)
UNDAMPED = np.zeros(3)


def quadratic(aim: npt.NDArray[np.float64], unit: npt.NDArray[np.float64]) -> Quadratic:
    """Of residuals that vanish at ``aim``."""
    return Quadratic.of([(SLOPES @ (unit - aim), SLOPES)])


def test_without_damping_a_step_ends_at_the_minimum_and_predicts_its_decrease() -> None:
    unit, aim = np.array([0.2, 0.5, 0.9]), np.array([0.6, 0.4, 0.3])
    near = quadratic(aim, unit)
    step = near.step(unit, UNDAMPED)
    np.testing.assert_allclose(unit + step, aim)
    assert near.decrease(step[None])[0] == pytest.approx(0.5 * np.sum((SLOPES @ (unit - aim)) ** 2))


def test_recordings_add_up() -> None:
    unit = np.array([0.2, 0.5, 0.9])
    parts = [(OFFSET[:8], SLOPES[:8]), (OFFSET[8:], SLOPES[8:])]
    whole, split = Quadratic.of([(OFFSET, SLOPES)]), Quadratic.of(parts)
    np.testing.assert_allclose(whole.step(unit, UNDAMPED), split.step(unit, UNDAMPED))


def test_a_step_stops_at_the_box_and_the_other_genes_make_up_for_it() -> None:
    unit, aim = np.array([0.2, 0.5, 0.9]), np.array([1.5, 0.4, 0.3])
    end = unit + quadratic(aim, unit).step(unit, UNDAMPED)
    assert end[0] == pytest.approx(1.0)
    free = np.linalg.lstsq(SLOPES[:, 1:], -SLOPES[:, 0] * (1.0 - aim[0]), rcond=None)[0]
    np.testing.assert_allclose(end[1:], aim[1:] + free, rtol=1e-9)


def test_damping_shortens_a_step_and_turns_it_downhill() -> None:
    unit = np.full(3, 0.5)
    near = quadratic(np.array([0.6, 0.4, 0.45]), unit)
    lengths = [float(np.linalg.norm(near.step(unit, np.full(3, d)))) for d in (0.0, 10.0, 1e3, 1e5)]
    assert lengths == sorted(lengths, reverse=True)
    long = near.step(unit, np.full(3, 1e8))
    np.testing.assert_allclose(long / np.linalg.norm(long), -near.slope / np.linalg.norm(near.slope), rtol=1e-5)


def test_of_several_steps_the_one_that_lowers_the_cost_most_is_taken_if_it_keeps_its_promise() -> None:
    units, predicted = np.zeros((4, 1)), np.array([4.0, 2.0, 0.0, 3.0])
    trials = Trials.of(units, predicted, 10.0, np.array([8.0, 9.0, 1.0, 5.0]), (None, None, None, "it flutters"))
    assert trials.best() == 0
    assert trials.gain(0) == 0.5
    assert trials.best(least_gain=0.6) is None
    assert Trials.of(units, predicted, 10.0, np.full(4, 10.0), (None,) * 4).best() is None
