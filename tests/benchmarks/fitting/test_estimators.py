from __future__ import annotations

import pytest

from benchmarks.estimators import Point, _random_row, reached, row, trace

SLOW = [Point(50, 1.0, 4.0), Point(100, 2.0, 1.005), Point(150, 3.0, 1.0)]


def test_the_cost_is_that_of_the_first_state_as_good_as_the_floor() -> None:
    assert reached(SLOW, 1.0) == SLOW[1]
    assert reached(SLOW[:1], 1.0) is None
    assert row("slow", SLOW, 1.0) == {
        "method": "slow",
        "evaluations": 100,
        "seconds": 2.0,
        "misfit_over_floor": 1.0,
        "evaluations_in_all": 150,
        "seconds_in_all": 3.0,
    }
    never = row("never", SLOW[:1], 1.0)
    assert never["evaluations"] is None
    assert never["misfit_over_floor"] == 4.0


def test_a_trace_keeps_the_best_so_far() -> None:
    """A Gauss-Newton iteration may raise the sum of squares a little; what was found stays found."""
    points = trace("test", [(10, 3.0), (20, 1.0), (30, 1.5)])
    assert [(p.evaluations, p.squares) for p in points] == [(10, 3.0), (20, 1.0), (30, 1.0)]
    assert all(p.seconds >= 0 for p in points)


def test_random_starts_are_counted_and_represented_by_their_median() -> None:
    starts = [[Point(n, n / 10, best)] for n, best in ((300, 1.0), (100, 1.0), (200, 1.0), (50, 3.0))]
    found = _random_row([*starts, []], 1.0)
    assert (found["starts"], found["starts_that_reach_the_floor"]) == (5, 3)
    assert found["evaluations"] == 200
    none = _random_row([[]], 1.0)
    assert none["evaluations"] is None
    assert none["starts_that_reach_the_floor"] == pytest.approx(0)
