"""Which of the competing fits from the estimates continue, and where they start."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import SUSPECTS
from wingfit.diagnosis.evidence.competing_fits import (
    FIRST_STEPS,
    _CompetingFits,
    fit_from_estimates,
    large_start,
    start_points,
)
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import InitialSimulationError
from wingfit.diagnosis.evidence.screen import Trial, off_units
from wingfit.diagnosis.policy import POLICY

NOTHING = cast("Any", None)
FALLING = [2000.0 - 100.0 * k for k in range(20)]


def data(noise: float = 0.0) -> Any:
    """Data for which a fit's cost is its excess."""
    return SimpleNamespace(
        policy=POLICY,
        excess=lambda c: c,
        likelihood_weight=lambda c: 1.0,  # noqa: ARG005
        chi_squared=lambda c: c,
        noise=noise,
        excess_standard_error=0.0,
        excess_by_chance=lambda _: 0.0,
        accepted=0.0,
        gene_cost=POLICY.gene_cost,
        kind="tracks",
    )


@pytest.fixture
def compete(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs competing fits with given costs by step; returns the winner, its cost, and the number of steps of each.

    A list given as ``rivals`` gets the names of the rivals at the end, best first. A fit's only gene is a thousandth of
    its cost; fits whose names begin with the same word are of one suspect.
    """

    def run(
        costs: Mapping[str, list[float]],
        limit: float = np.inf,
        target: float = np.inf,
        noise: float = 0.0,
        rivals: list[str] | None = None,
    ) -> tuple[str, float, dict[str, int]]:
        steps_run = dict.fromkeys(costs, 0)
        entered: Any = tuple(SimpleNamespace(name=name, names=(name.split()[0],)) for name in costs)

        def steps(*arguments: Any) -> Iterator[Any]:
            name = arguments[-1].name
            if not costs[name]:
                raise InitialSimulationError("it cannot be simulated")
            for cost in costs[name]:
                steps_run[name] += 1
                yield SimpleNamespace(cost=cost, coefficients=cost, unit=np.array([1e-3 * cost]))

        monkeypatch.setattr("wingfit.diagnosis.evidence.competing_fits._from_estimates", steps)
        found: Any = list(
            fit_from_estimates(FitContext(NOTHING, data(noise), NOTHING), NOTHING, entered, limit, target)
        )
        if rivals is not None:
            rivals.extend(entry.name for entry, _ in found[-1])
        return (found[-1][0][0].name, found[-1][0][1].cost, steps_run) if found else ("", np.inf, steps_run)

    return run


def test_a_failed_fit_does_not_stop_the_others(compete: Any) -> None:
    winner, cost, steps_run = compete({"never": [], "early": [900.0], "wins": FALLING[:15]})
    assert (winner, cost) == ("wins", 600.0)
    assert steps_run == {"never": 0, "early": 1, "wins": 15}
    assert compete({"never": []}) == ("", np.inf, {"never": 0})


def test_a_late_fit_may_still_win(compete: Any) -> None:
    """The leader ends where genes imitate the effect; the effect itself finds its location later."""
    winner, cost, steps_run = compete(
        {"leads": [50.0, 20.0, 18.0, 17.0, 16.9, 16.9], "late": [300.0, 50.0, 40.0, 30.0, 20.0, 0.5]}
    )
    assert (winner, cost) == ("late", 0.5)
    assert steps_run["late"] == 6


def test_a_slow_fit_far_behind_is_stopped(compete: Any) -> None:
    _, _, steps_run = compete({"best": [50.0, 5.0, 2.0, 1.0, 0.9, 0.8, 0.7], "crawls": [50.0, 40.0, *[39.99] * 12]})
    assert steps_run["crawls"] == 3
    assert steps_run["best"] == 7
    _, _, steps_run = compete({"crawls": [50.0, 40.0, *[39.99] * 12]}, limit=30.0)
    assert steps_run["crawls"] == 3
    _, _, steps_run = compete({"falls": FALLING}, limit=1.0)
    assert steps_run["falls"] > FIRST_STEPS, "a fit that still improves is not stopped, however large its excess"


def test_a_fit_that_would_miss_the_target_is_stopped(compete: Any) -> None:
    """It gains a tenth with every step and might gain a quarter: a twentieth would remain after ten steps."""
    slow = [1e4 * 0.9**k for k in range(16)]
    leads = [900.0 - k for k in range(6)]
    assert compete({"slow": slow, "leads": leads}, target=3e3)[2]["slow"] == 15
    assert compete({"slow": slow, "leads": leads}, target=50.0)[2]["slow"] == FIRST_STEPS
    assert compete({"slow": slow}, target=50.0)[2]["slow"] == 15, "the leader continues"
    assert compete({"slow": slow, "done": [5e3, 500.0, 5.0, 1.0, 1.0, 1.0]})[2]["slow"] == FIRST_STEPS


def test_a_fit_that_may_accelerate_continues(compete: Any) -> None:
    """At its first rate it would end at four times the leader's cost and be stopped; but it accelerates."""
    slow = [1e4 * 0.9**k for k in range(5)]
    later = [slow[-1] * 0.7**k for k in range(1, 11)]
    leads = [600.0 - k for k in range(8)]
    winner, _, steps_run = compete({"leads": leads, "late": slow + later})
    assert winner == "late"
    assert steps_run["late"] == 15


def test_no_fit_is_extrapolated_before_the_first_steps(compete: Any) -> None:
    winner, _, steps_run = compete(
        {"leads": [2.0, 1.9, 1.8, 1.7, 1.6], "late": [1000.0, 970.0, 500.0, 100.0, 3.0, 1.0]}
    )
    assert winner == "late"
    assert steps_run["late"] == 6


def test_fewer_remaining_steps_promise_less(compete: Any) -> None:
    """At a tenth per step it could still reach the leader by the last step, but no longer some steps later."""
    steps_run = compete({"leads": [167.0 - 0.01 * k for k in range(9)], "late": [1e4 * 0.9**k for k in range(16)]})[2]
    assert FIRST_STEPS < steps_run["late"] < 12


@pytest.mark.parametrize("late", [[100.0, 101.0, 20.0], [100.0, 10.0, -50.0, -70.0]])
def test_a_rising_or_negative_excess_is_not_extrapolated(compete: Any, late: list[float]) -> None:
    """Extrapolated by its last ratio, such an excess would grow without bound."""
    leads = [90.0, 80.0, 70.0, 60.0, 50.0, 40.0] if late[-1] > 0.0 else [0.0, -20.0, -40.0, -60.0]
    steps_run = compete({"leads": leads, "late": [400.0, 300.0, 200.0, *late]}, noise=1.0)[2]
    assert steps_run["late"] == 3 + len(late)


def test_fits_within_the_noise_of_a_perfect_one_continue(compete: Any) -> None:
    costs = {"best": [100.0, 10.0, *[0.0] * 13], "close": [100.0, 1.0, *[0.05] * 13]}
    assert compete(costs, noise=1.0)[2]["close"] == 15
    assert compete(costs, noise=0.1)[2]["close"] < 5


def test_of_two_equal_fits_one_continues(compete: Any) -> None:
    one = [1e3 * 0.7**k for k in range(16)]
    other = [2 * cost for cost in one]
    assert compete({"mass here": one, "mass there": other})[2] == {"mass here": 15, "mass there": 11}
    assert compete({"mass here": one, "damage there": other})[2] == {"mass here": 15, "damage there": 15}


def test_of_two_equal_fits_the_better_continues_behind_a_leader(compete: Any) -> None:
    costs = {"wins": 100.0, "mass here": 200.0, "mass there": 230.0}
    steps_run = compete({name: [cost * 0.97**k for k in range(16)] for name, cost in costs.items()})[2]
    assert steps_run["wins"] == steps_run["mass here"] == 15
    assert steps_run["mass there"] < 15


def test_the_result_is_the_best_and_its_rivals(compete: Any) -> None:
    rivals = list[str]()
    compete({"far": [90.0, 80.0], "close": [60.0, 20.0], "best": [50.0, 10.0], "never": []}, rivals=rivals)
    assert rivals == ["best", "close"]


def test_the_best_by_cost_comes_first_despite_a_larger_excess() -> None:
    """The cost includes the prior of the genes."""
    compete = _CompetingFits(data(), np.inf, np.inf)
    best, other = (cast("Any", SimpleNamespace(cost=cost, coefficients=left)) for cost, left in ((10, 100), (20, 1)))
    for fit in (best, other):
        compete.add(NOTHING, iter([fit]))
    *_, rivals = compete.run(1)
    assert [fit for _, fit in rivals] == [best, other]


def trial(name: str, unit: list[float]) -> Trial:
    """A trial of the pendulum's suspect ``name`` at genes ``unit``, in unit coordinates."""
    suspect = next(one for one in SUSPECTS if one.name == name)
    return Trial(suspect, np.array([unit]), np.zeros((1, 1)), 0.0, np.ones(1), len(unit), 0.0)


def test_start_points_are_the_trials_and_the_typical_location() -> None:
    """Both of typical size, 5 g of 30 g; the typical location is 0.7 of the arm."""
    own, typical = start_points(trial("point_mass", [0.9, 0.2]))
    np.testing.assert_allclose(own.unit, [1 / 6, 0.2])
    np.testing.assert_allclose(typical.unit, [1 / 6, 0.7])
    assert len(start_points(trial("point_mass", [0.9, 0.7]))) == 1
    assert len(start_points(trial("friction", [0.5]))) == 1
    other = trial("point_mass", [0.9, 0.2])
    placeless = replace(other, suspect=replace(other.suspect, location_genes={}))
    assert len(start_points(placeless)) == 1, "its second gene is then a shape, not a location"


def test_a_large_start_has_the_sign_of_the_score_test() -> None:
    """Three times 5 g of 30 g, at the location of the trial or the typical; a friction of either sign, in bounds."""
    mass = trial("point_mass", [0.9, 0.2])
    np.testing.assert_allclose(large_start(mass).unit, [0.5, 0.2])
    np.testing.assert_allclose(large_start(mass, typical_shape=True).unit, [0.5, 0.7])
    cubic = trial("cubic", [0.6])
    positive, negative = (large_start(replace(cubic, multiples=np.array([one]))).unit for one in (1.0, -1.0))
    (off,) = off_units(cubic.suspect)
    assert negative[0] < off < positive[0]


def test_other_effects_start_at_their_fitted_genes() -> None:
    free = ("stiffness", "gain.part", "cubic.k3")
    refit = cast(
        "Any", SimpleNamespace(fit=SimpleNamespace(problem=SimpleNamespace(free=free), unit=np.array([0.3, 0.6, 0.8])))
    )
    cubic = trial("cubic", [0.5])
    first, _ = start_points(trial("point_mass", [0.9, 0.2]), [cubic], refit)
    assert [one.suspect.name for one in first.trials] == ["cubic", "point_mass"]
    np.testing.assert_allclose(first.unit, [0.8, 1 / 6, 0.2])
