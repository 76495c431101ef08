"""The solver of rigs: right, bounded by the last instant, and the same bits in threads that run at once."""

from __future__ import annotations

import resource
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy

from wingfit.records.array_types import Array
from wingfit.rigs.lsoda import lsoda
from wingfit.rigs.run import Run, SimulationError

TIMES = np.linspace(0.0, 3.0, 61)
TOLERANCE = np.full(2, 1e-10)


def swing(_: float, state: Array) -> list[float]:
    return [state[1], -0.3 * state[1] - 40.0 * np.sin(state[0])]


def test_it_agrees_with_another_method_of_higher_order() -> None:
    found, failed = lsoda(swing, np.array([1.2, 0.0]), TIMES, 1e-9, TOLERANCE, np.inf)
    other = scipy.integrate.solve_ivp(swing, (0.0, 3.0), [1.2, 0.0], "DOP853", TIMES, rtol=1e-12, atol=1e-13)
    assert failed is None
    assert np.abs(found - other.y).max() < 2e-7


def test_stiff_motion_is_solved_by_few_rates() -> None:
    """A decay of 1e5/s that follows a cosine; explicit steps would need 1e5 rates."""
    count = 0

    def rate(t: float, state: Array) -> list[float]:
        nonlocal count
        count += 1
        return [-1e5 * (state[0] - np.cos(t))]

    found, failed = lsoda(rate, np.array([1.0]), TIMES, 1e-8, TOLERANCE[:1], np.inf)
    assert failed is None
    assert np.abs(found[0] - np.cos(TIMES)).max() < 2e-5
    assert count < 2000


def test_no_rate_is_evaluated_beyond_the_last_instant() -> None:
    seen: list[float] = []

    def watched(t: float, state: Array) -> list[float]:
        seen.append(t)
        return swing(t, state)

    lsoda(watched, np.array([1.2, 0.0]), TIMES, 1e-8, TOLERANCE, np.inf)
    assert max(seen) == TIMES[-1]


def test_what_a_rate_does_to_its_state_changes_nothing() -> None:
    kept: list[Array] = []

    def greedy(t: float, state: Array) -> list[float]:
        kept.append(state)
        rates = swing(t, state)
        state[:] = 7.0
        return rates

    start = np.array([1.2, 0.0])
    found, _ = lsoda(greedy, start, TIMES, 1e-8, TOLERANCE, np.inf)
    np.testing.assert_array_equal(found, lsoda(swing, start, TIMES, 1e-8, TOLERANCE, np.inf)[0])
    assert np.all(np.array(kept) == 7.0)
    assert start.tolist() == [1.2, 0.0]


def test_threads_that_integrate_at_once_get_the_same_bits() -> None:
    starts = [np.array([0.1 * k, 0.0]) for k in range(1, 13)]

    def solved(start: Array) -> Array:
        return lsoda(swing, start, TIMES, 1e-8, TOLERANCE, np.inf)[0]

    alone = [solved(start) for start in starts]
    with ThreadPoolExecutor(6) as pool:
        for one, other in zip(alone, pool.map(solved, starts), strict=True):
            np.testing.assert_array_equal(one, other)


def test_errors_of_the_rate_are_passed_on_and_the_next_integration_works() -> None:
    def broken(t: float, _: Array) -> list[float]:
        if t > 1.0:
            raise ZeroDivisionError("at one second")
        return [0.0, 0.0]

    with pytest.raises(ZeroDivisionError, match="at one second"):
        lsoda(broken, np.zeros(2), TIMES, 1e-8, TOLERANCE, 0.1)
    assert lsoda(swing, np.array([1.2, 0.0]), TIMES, 1e-8, TOLERANCE, np.inf)[1] is None


def test_a_rate_may_integrate_too() -> None:
    """The rate is the mean of exp(-y) over one second, (1 - 1/e) y(0), so that y grows by exp((1 - 1/e) t)."""
    inner = np.linspace(0.0, 1.0, 3)

    def outer(_: float, state: Array) -> list[float]:
        area = lsoda(lambda s, _: [state[0] * np.exp(-s)], np.zeros(1), inner, 1e-9, TOLERANCE[:1], np.inf)[0]
        return [float(area[0, -1])]

    found, failed = lsoda(outer, np.array([1.0]), TIMES[:11], 1e-8, TOLERANCE[:1], np.inf)
    assert failed is None
    np.testing.assert_allclose(found[0], np.exp((1.0 - np.exp(-1.0)) * TIMES[:11]), rtol=1e-6)


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        (lambda _, __: [np.nan], "grows without bound|the integration fails"),
        (lambda t, y: [float("inf") if t > 1.0 else -y[0]], "grows without bound|the integration fails|no progress"),
    ],
)
def test_rates_that_are_not_finite_fail_with_a_reason(rate: object, message: str) -> None:
    run = Run("one", TIMES, {}, {}, TIMES)
    with pytest.raises(SimulationError, match=message):
        run.integrate(rate, [1.0])  # type: ignore[arg-type]


def test_no_rate_allocates_a_chunk_of_frames_at_any_depth_of_the_stack() -> None:
    """Every page of a new chunk is a page fault; at an unlucky depth each of the rates would cause some."""
    rates = 0

    def rate(t: float, state: Array) -> list[float]:
        nonlocal rates
        rates += 1
        return swing(t, state)

    def faults_at(depth: int) -> int:
        if depth > 0:
            return faults_at(depth - 1)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        lsoda(rate, np.ones(2), TIMES, 1e-8, TOLERANCE, np.inf)
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

    faults_at(0)  # what is allocated once
    each = rates
    assert each > 500
    assert max(faults_at(depth) for depth in range(0, 200, 3)) < each / 2
