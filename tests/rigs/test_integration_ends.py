"""Integrations: Runge-Kutta steps converge, and an integration that would never end fails with a reason."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.rigs import run as module
from wingfit.rigs.run import Run, SimulationError

TIMES = np.linspace(0.0, 1.0, 11)


def test_motion_that_escapes_in_finite_time_fails_with_a_reason() -> None:
    run = Run("fall", TIMES, {}, {}, TIMES)
    with pytest.raises(SimulationError, match="grows without bound"):
        run.integrate(lambda _, y: [y[1], -60.0 * y[0] - 300.0 * y[0] ** 2 - 10.0], [0.1, 0.0])


def test_solver_without_progress_fails_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_RATES", 10)
    monkeypatch.setattr(module, "RATES_PER_SAMPLE", 1)
    run = Run("swing", TIMES, {}, {}, TIMES)
    with pytest.raises(SimulationError, match="no progress"):
        run.integrate(lambda _, y: [y[1], -400.0 * y[0]], [1.0, 0.0])


def test_runge_kutta_steps_converge_with_the_fourth_power() -> None:
    def error(steps: int) -> float:
        run = Run("swing", TIMES, {}, {}, TIMES)
        found = run.integrate(lambda _, y: [y[1], -25.0 * y[0]], [1.0, 0.0], steps=steps)
        return float(np.abs(found[0] - np.cos(5.0 * TIMES)).max())

    assert error(1) / error(2) == pytest.approx(16.0, rel=0.2)
    assert error(8) < 1e-6


def test_runge_kutta_follows_the_kinks_of_an_input() -> None:
    push = np.where(np.arange(11) % 2, 1.0, -1.0)
    run = Run("push", TIMES, {}, {"push": push}, TIMES)
    found = run.integrate(lambda t, _: [float(run.input("push", t))], [0.0], steps=1)
    exact = np.concatenate([[0.0], np.cumsum((push[1:] + push[:-1]) / 2.0 * 0.1)])
    np.testing.assert_allclose(found[0], exact, atol=1e-12)


@pytest.mark.parametrize("at", range(2, 60, 7))
def test_a_short_pulse_of_an_input_is_not_missed(at: int) -> None:
    times = np.linspace(0.0, 6.0, 61)
    push = np.where(np.arange(61) == at, 1.0, 0.0)
    run = Run("hammer", times, {}, {"push": push}, times)
    speed = run.integrate(lambda t, _: [float(run.input("push", t))], [0.0])[0]
    assert speed[-1] == pytest.approx(0.1, rel=1e-4)  # the triangle of one sample


def test_states_of_different_size_are_all_exact() -> None:
    """A displacement of 1e-4 m beside a pressure of 1e5 Pa."""
    run = Run("both", TIMES, {}, {}, TIMES)
    found = run.integrate(lambda _, y: [y[1], -400.0 * y[0], -0.5 * y[2]], [1e-4, 0.0, 1e5])
    np.testing.assert_allclose(found[0], 1e-4 * np.cos(20.0 * TIMES), atol=1e-9)
    np.testing.assert_allclose(found[2], 1e5 * np.exp(-0.5 * TIMES), rtol=1e-6)


def test_a_single_small_state_is_exact() -> None:
    run = Run("charge", TIMES, {}, {}, TIMES)
    found = run.integrate(lambda _, y: [-3.0 * y[0]], [1e-11])
    np.testing.assert_allclose(found[0], 1e-11 * np.exp(-3.0 * TIMES), rtol=1e-5)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("count", [1, 2, 24, 25, 100])
@pytest.mark.parametrize("value", [1e101, -1e200, np.inf, -np.inf, np.nan])
def test_a_state_that_escapes_is_noticed_without_a_warning(count: int, value: float) -> None:
    run = Run("one", TIMES, {}, {}, TIMES)
    start = np.ones(count)
    assert run.integrate(lambda _, y: np.zeros(len(y)), start, steps=1)[0, -1] == 1.0
    start[count // 2] = value
    with pytest.raises(SimulationError, match="grows without bound"):
        run.integrate(lambda _, y: np.zeros(len(y)), start, steps=1)
