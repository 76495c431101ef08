"""Which fits go on in a race from the estimates, and where the fits begin."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import SUSPECTS
from wingfit.diagnosis.evidence.competing_fits import FIRST_STEPS, _CompetingFits, fit_from_estimates, start_points
from wingfit.diagnosis.evidence.fit import InitialSimulationError
from wingfit.diagnosis.evidence.screen import Trial
from wingfit.diagnosis.policy import POLICY

NOTHING = cast("Any", None)
FALLING = [2000.0 - 100.0 * k for k in range(20)]


def data(noise: float = 0.0) -> Any:
    """One for which a fit's cost is what it leaves, and counts in full."""
    return SimpleNamespace(
        policy=POLICY,
        excess=lambda c: c,
        likelihood_weight=lambda c: 1.0,  # noqa: ARG005
        chi_squared=lambda c: c,
        noise=noise,
        excess_standard_error=0.0,
    )


@pytest.fixture
def race(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs a race of fits with costs by step; the winner, its cost, and how many steps of each were asked for.

    A list given as ``front`` gets the names of those that are rivals at the end, the best first.
    A fit's only gene is a thousandth of its cost; those with names that begin with the same word are of one suspect.
    """

    def run(
        costs: Mapping[str, list[float]],
        max_excess: float = np.inf,
        target_excess: float = np.inf,
        noise: float = 0.0,
        front: list[str] | None = None,
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
            fit_from_estimates(NOTHING, data(noise), NOTHING, NOTHING, entered, max_excess, target_excess)
        )
        if front is not None:
            front.extend(entry.name for entry, _ in found[-1])
        return (found[-1][0][0].name, found[-1][0][1].cost, steps_run) if found else ("", np.inf, steps_run)

    return run


def test_one_that_cannot_be_simulated_does_not_hinder_the_others(race: Any) -> None:
    winner, cost, steps_run = race({"never": [], "early": [900.0], "wins": FALLING[:15]})
    assert (winner, cost) == ("wins", 600.0)
    assert steps_run == {"never": 0, "early": 1, "wins": 15}
    assert race({"never": []}) == ("", np.inf, {"never": 0})


def test_one_that_fell_behind_at_first_may_still_win(race: Any) -> None:
    """The leader ends at what makes up for the effect; the effect itself finds its place later."""
    winner, cost, steps_run = race(
        {"leads": [50.0, 20.0, 18.0, 17.0, 16.9, 16.9], "late": [300.0, 50.0, 40.0, 30.0, 20.0, 0.5]}
    )
    assert (winner, cost) == ("late", 0.5)
    assert steps_run["late"] == 6


def test_one_that_crawls_far_behind_is_given_up(race: Any) -> None:
    _, _, steps_run = race({"best": [50.0, 5.0, 2.0, 1.0, 0.9, 0.8, 0.7], "crawls": [50.0, 40.0, *[39.99] * 12]})
    assert steps_run["crawls"] == 3
    assert steps_run["best"] == 7
    _, _, steps_run = race({"crawls": [50.0, 40.0, *[39.99] * 12]}, max_excess=30.0)
    assert steps_run["crawls"] == 3
    _, _, steps_run = race({"falls": FALLING}, max_excess=1.0)
    assert steps_run["falls"] > FIRST_STEPS, "one that still falls is not given up, however much it leaves"


def test_one_that_would_not_come_to_what_is_wanted_is_given_up(race: Any) -> None:
    """It gains a tenth with every step, and might gain a quarter: in ten steps that leaves a twentieth."""
    slow = [1e4 * 0.9**k for k in range(16)]
    leads = [900.0 - k for k in range(6)]
    assert race({"slow": slow, "leads": leads}, target_excess=3e3)[2]["slow"] == 15
    assert race({"slow": slow, "leads": leads}, target_excess=50.0)[2]["slow"] == FIRST_STEPS
    assert race({"slow": slow}, target_excess=50.0)[2]["slow"] == 15, "what leads goes on"
    assert race({"slow": slow, "done": [5e3, 500.0, 5.0, 1.0, 1.0, 1.0]})[2]["slow"] == FIRST_STEPS


def test_one_that_is_slow_at_first_but_may_get_faster_goes_on(race: Any) -> None:
    """At its first rate it would end at four times the cost of the leader and be given up; but later it gets faster."""
    slow = [1e4 * 0.9**k for k in range(5)]
    later = [slow[-1] * 0.7**k for k in range(1, 11)]
    leads = [600.0 - k for k in range(8)]
    winner, _, steps_run = race({"leads": leads, "late": slow + later})
    assert winner == "late"
    assert steps_run["late"] == 15


def test_one_that_begins_slowly_is_not_judged_before_it_has_run_the_race(race: Any) -> None:
    winner, _, steps_run = race({"leads": [2.0, 1.9, 1.8, 1.7, 1.6], "late": [1000.0, 970.0, 500.0, 100.0, 3.0, 1.0]})
    assert winner == "late"
    assert steps_run["late"] == 6


def test_the_fewer_steps_are_left_the_less_is_expected_of_them(race: Any) -> None:
    """At a tenth a step it might still come near the leader when the race ends, but no more some steps later."""
    steps_run = race({"leads": [167.0 - 0.01 * k for k in range(9)], "late": [1e4 * 0.9**k for k in range(16)]})[2]
    assert FIRST_STEPS < steps_run["late"] < 12


@pytest.mark.parametrize("late", [[100.0, 101.0, 20.0], [100.0, 10.0, -50.0, -70.0]])
def test_one_whose_misfit_rises_or_sinks_below_the_noise_is_not_extrapolated(race: Any, late: list[float]) -> None:
    """As powers of its last ratio such a misfit would grow beyond all bounds."""
    leads = [90.0, 80.0, 70.0, 60.0, 50.0, 40.0] if late[-1] > 0.0 else [0.0, -20.0, -40.0, -60.0]
    steps_run = race({"leads": leads, "late": [400.0, 300.0, 200.0, *late]}, noise=1.0)[2]
    assert steps_run["late"] == 3 + len(late)


def test_beside_one_that_leaves_nothing_others_within_the_noise_go_on(race: Any) -> None:
    costs = {"best": [100.0, 10.0, *[0.0] * 13], "close": [100.0, 1.0, *[0.05] * 13]}
    assert race(costs, noise=1.0)[2]["close"] == 15
    assert race(costs, noise=0.1)[2]["close"] < 5


def test_of_two_that_have_come_to_the_same_one_goes_on(race: Any) -> None:
    one = [1e3 * 0.7**k for k in range(16)]
    other = [2 * cost for cost in one]
    assert race({"mass here": one, "mass there": other})[2] == {"mass here": 15, "mass there": 11}
    assert race({"mass here": one, "damage there": other})[2] == {"mass here": 15, "damage there": 15}


def test_of_two_that_have_come_to_the_same_the_better_goes_on_though_a_third_leads(race: Any) -> None:
    costs = {"wins": 100.0, "mass here": 200.0, "mass there": 230.0}
    steps_run = race({name: [cost * 0.97**k for k in range(16)] for name, cost in costs.items()})[2]
    assert steps_run["wins"] == steps_run["mass here"] == 15
    assert steps_run["mass there"] < 15


def test_what_a_race_gives_are_the_rivals_of_the_best(race: Any) -> None:
    front = list[str]()
    race({"far": [90.0, 80.0], "close": [60.0, 20.0], "best": [50.0, 10.0], "never": []}, front=front)
    assert front == ["best", "close"]


def test_the_best_by_cost_is_listed_though_another_leaves_far_less() -> None:
    """Cost counts the prior of the genes as well."""
    race = _CompetingFits(data(), np.inf, np.inf)
    best, other = (cast("Any", SimpleNamespace(cost=cost, coefficients=left)) for cost, left in ((10, 100), (20, 1)))
    for fit in (best, other):
        race.add(NOTHING, iter([fit]))
    *_, front = race.run(1)
    assert [fit for _, fit in front] == [best, other]


def trial(name: str, unit: list[float]) -> Trial:
    """A suspect of the pendulum at the genes ``unit``, in parts of their boxes."""
    suspect = next(one for one in SUSPECTS if one.name == name)
    return Trial(suspect, np.array([unit]), np.zeros((1, 1)), 0.0, np.ones(1), len(unit), 0.0)


def test_a_fit_begins_where_the_trial_was_and_at_the_typical_place() -> None:
    """Of typical size both: 5 g of 30 g; the typical place is 0.7 of the arm."""
    own, typical = start_points(trial("point_mass", [0.9, 0.2]))
    np.testing.assert_allclose(own.unit, [1 / 6, 0.2])
    np.testing.assert_allclose(typical.unit, [1 / 6, 0.7])
    assert len(start_points(trial("point_mass", [0.9, 0.7]))) == 1
    assert len(start_points(trial("friction", [0.5]))) == 1
    other = trial("point_mass", [0.9, 0.2])
    placeless = replace(other, suspect=replace(other.suspect, location_genes={}))
    assert len(start_points(placeless)) == 1, "its second gene is a shape, and no place"


def test_what_stays_beside_it_begins_where_it_was_fitted() -> None:
    free = ("stiffness", "gain.part", "cubic.k3")
    refit = cast(
        "Any", SimpleNamespace(fit=SimpleNamespace(problem=SimpleNamespace(free=free), unit=np.array([0.3, 0.6, 0.8])))
    )
    cubic = trial("cubic", [0.5])
    first, _ = start_points(trial("point_mass", [0.9, 0.2]), [cubic], refit)
    assert [one.suspect.name for one in first.trials] == ["cubic", "point_mass"]
    np.testing.assert_allclose(first.unit, [0.8, 1 / 6, 0.2])
