"""Gauss-Newton from several starts (method auto): which are tried, when they end, and what of them is reported."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy.typing as npt
import pytest

from tests.calibration.conftest import FORCE_TRUTHS
from tests.calibration.starts.conftest import (
    RIGHT,
    WRONG,
    Failing,
    population,
    progress_is_sound,
    ran,
    searched,
    step,
)
from tests.calibration.test_search import SPEC as SEARCH
from tests.calibration.test_search import THREE, Here
from wingfit.calibration import search
from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.preparation import Prepared, prepare
from wingfit.calibration.problem import Evaluation, Problem, base_genome
from wingfit.calibration.search import CalibrationSpec, Generation, calibrate
from wingfit.calibration.starts import AGREE, APART, MOST, SEARCHED, SHIFT, Ends, apart, doubts
from wingfit.records import Dataset, Genome
from wingfit.records.blas_threads import one_blas_thread
from wingfit.workers.errors import EvaluationInterruptedError


def ends(*costs: float) -> Ends:
    made = Ends()
    for cost in costs:
        made.add(step(cost), last=True)
    return made


def test_starts_lie_apart_best_first() -> None:
    near = 0.99 * APART
    units = [[0.5, 0.5], [0.5 + near, 0.5 - near], [0.5, 0.5 + APART + 1e-9], [0.0, 0.5], [0.0, 0.5 + near], [1.0, 1.0]]
    assert apart(population(units)) == [units[0], units[2], units[3], units[5]]
    many = [[k / 20, 0.0] for k in range(0, 20, 3)]
    assert len(many) > MOST
    assert apart(population(many)) == many[:MOST]


def test_a_converged_population_is_confirmed_by_a_start_off_it() -> None:
    assert apart(population([[0.5, 0.6]] * 20)) == [[0.5, 0.6], [0.5 + SHIFT, 0.6 - SHIFT]]
    assert apart(population([[0.2]])) == [[0.2]], "a single individual has not converged"


def test_a_failed_individual_is_no_start() -> None:
    units = [[0.0], [0.5], [1.0]]
    assert apart(population(units)) == units
    assert apart(population(units, failed=1)) == units[:2]
    assert apart(population(units, failed=3)) == []


@pytest.mark.parametrize(
    ("costs", "agreed"),
    [
        ((), False),
        ((5.0,), False),
        ((5.0, 5.0 + AGREE), True),
        ((5.0, 5.0 + 1.01 * AGREE), False),
        ((5.0, 9.0, 4.5), True),
        ((5.0, 5.0, 5.0 - 2 * AGREE), False),
        ((-7.0, 3.0, -7.0), True),
    ],
)
def test_two_ends_agree_only_about_the_least_cost(costs: tuple[float, ...], agreed: bool) -> None:
    assert ends(*costs).agreed is agreed


def test_long_recordings_end_less_exactly_and_agree_within_that() -> None:
    made = Ends()
    for cost in (5.0, 5.0 + 2 * AGREE):
        made.add(replace(step(cost), flat=0.6 * AGREE), last=True)
    assert made.agreed


def test_the_best_is_the_least_cost_of_all_starts() -> None:
    found = ends(5.0, 3.0, 4.0)
    assert (found.best().cost, found.best().fitness, found.best().distance) == (3.0, 6.0, 9.0)
    assert found.best().values == {"a": 3.0}
    found.add(step(6.0), last=False)
    assert found.best().cost == 3.0, "the present start is behind"
    found.add(step(2.0, 1), last=False)
    assert found.best().cost == 2.0, "the present start is ahead"
    assert (len(found.done), found.tried, found.newton, found.iterations) == (3, 3, {"index": 1}, 5)
    with pytest.raises(ValueError, match="empty"):
        Ends().best()


def test_an_end_ends_the_iterations_and_a_failure_leaves_what_was_reached() -> None:
    found = Ends()
    found.add(step(5.0), last=False)
    found.add(step(4.0, 1), last=True)
    assert (found.tried, found.present, found.newton, found.iterations) == (1, None, None, 2)
    found.close()
    assert (found.tried, [end["cost"] for end in found.done]) == (2, [4.0]), "nothing was reached"
    found.add(step(3.0), last=False)
    found.close()
    assert (found.tried, [end["cost"] for end in found.done], found.newton) == (3, [4.0, 3.0], None)


def test_what_is_stored_does_not_change_later() -> None:
    found = ends(5.0)
    stored = dict(vars(found))
    before = json.dumps(stored)
    found.add(step(4.0), last=True)
    found.close()
    assert json.dumps(stored) == before


@one_blas_thread
def cost(ready: Prepared, genome: dict[str, float], stage: int = 0) -> float:
    """Negative log-likelihood at ``genome``."""
    one = ready.stages[stage]
    problem = Problem(ready.model, one.recordings, one.free, base_genome(ready.model), ready.spec.axes)
    return next(iterate(problem, Here(), genome)).cost


def test_a_start_that_ends_in_the_wrong_valley_does_not_win(valleys: Prepared, forces: Dataset) -> None:
    """The best individual leads to the wrong minimum; the search goes on to the second, which the third confirms."""
    whole = ran(valleys, forces, -3.0, 3.0, 1.9, 0.6)
    done = whole[-1].checkpoint["ends"]["done"]
    assert [end["values"]["a"] for end in done] == pytest.approx([WRONG, RIGHT, RIGHT], abs=0.2)
    assert done[0]["cost"] > done[1]["cost"] + 100 * AGREE
    assert abs(done[1]["cost"] - done[2]["cost"]) < AGREE
    assert whole[-1].genome["a"] == pytest.approx(RIGHT, abs=0.01)
    assert whole[-1].checkpoint["found"]["joint"] == whole[-1].genome
    assert {g.stage for g in whole} == {"joint, Gauss-Newton"}
    assert [g.index for g in whole] == list(range(len(whole)))
    progress_is_sound(whole)
    alone = ran(valleys, forces, -3.0)
    assert alone[-1].genome["a"] == pytest.approx(WRONG, abs=0.2), "one start alone ends in the wrong valley"
    assert alone[-1].progress == 1
    assert (
        "stage 'joint': Gauss-Newton had only one start: the minimum is not confirmed"
        in doubts(alone[-1].checkpoint)[0]
    )
    assert doubts(whole[-1].checkpoint) == ()
    assert [g.genome for g in whole[: len(alone)]] == [g.genome for g in alone]


def test_the_best_that_is_reported_never_rises_in_cost(valleys: Prepared, forces: Dataset) -> None:
    """``mean`` is the present start's: it differs from ``best`` while a start is behind an earlier one."""
    whole = ran(valleys, forces, 3.0, -3.0, 1.9)
    costs = [cost(valleys, g.genome) for g in whole]
    assert all(after <= before + 1e-3 for before, after in pairwise(costs))
    first = whole[-1].checkpoint["ends"]["done"][0]
    behind = [g for g in whole if g.mean != g.best]
    assert any(g.genome["a"] == pytest.approx(first["values"]["a"]) for g in behind)
    assert max(g.mean for g in behind) > 10 * whole[-1].best


def test_resumed_after_any_iteration_equals_uninterrupted(valleys: Prepared, forces: Dataset) -> None:
    """Also where a start follows that fails at once: the third, the first, or the last."""
    for starts in ((-3.0, 3.0, 4.2, 1.9), (4.2, -3.0, 3.0), (-3.0, 3.0, 4.2)):
        whole = ran(valleys, forces, *starts, evaluator=Failing(4.1, 4.3))
        assert len(whole) > 6
        for cut, generation in enumerate(whole):
            checkpoint = json.loads(json.dumps(generation.checkpoint, allow_nan=False))
            assert list(calibrate(valleys.spec, forces, Failing(4.1, 4.3), checkpoint)) == whole[cut + 1 :]


def test_an_interruption_is_no_failed_start(valleys: Prepared, forces: Dataset) -> None:
    class Stopped(Here):
        def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
            if self.individuals > 60:
                raise EvaluationInterruptedError
            return super().evaluate(problem, values, residuals=residuals)

    seen: list[Generation] = []
    with pytest.raises(EvaluationInterruptedError):
        seen.extend(calibrate(valleys.spec, forces, Stopped(), searched(valleys, -3.0, 3.0, 1.9)))
    whole = ran(valleys, forces, -3.0, 3.0, 1.9)
    assert 0 < len(seen) < len(whole)
    assert list(calibrate(valleys.spec, forces, Here(), seen[-1].checkpoint)) == whole[len(seen) :]


@pytest.mark.parametrize(("most", "generations"), [(2, 2), (200, SEARCHED)])
def test_the_search_before_is_short(valleys: Prepared, forces: Dataset, most: int, generations: int) -> None:
    ready = replace(valleys, spec=replace(valleys.spec, max_generations=most, stall=1000))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "prepare", lambda *_: ready)
        evaluator = Here()
        whole = list(calibrate(ready.spec, forces, evaluator))
    names = [g.stage for g in whole]
    assert names[:generations] == ["joint"] * generations
    assert set(names[generations:]) == {"joint, Gauss-Newton"}
    assert whole[-1].genome["a"] == pytest.approx(RIGHT, abs=0.01)
    assert whole[-1].evaluations == evaluator.individuals
    progress_is_sound(whole)


def test_a_search_whose_every_individual_failed_ends(valleys: Prepared, forces: Dataset) -> None:
    with pytest.raises(ValueError, match="every individual of the first generation failed, the first: broken"):
        list(calibrate(valleys.spec, forces, Failing(-9.0, 9.0)))


def test_auto_takes_a_wing_to_the_bottom_and_resumes(small: tuple[Dataset, Genome]) -> None:
    """To where Gauss-Newton ends that starts at the truth; cut after every fourth generation."""
    dataset, truth = small
    spec = replace(SEARCH, genes=THREE, method="auto", mode="joint", max_generations=3)
    whole = list(calibrate(spec, dataset, Here()))
    assert [g.stage for g in whole[:4]] == ["joint"] * 3 + ["joint, Gauss-Newton"]
    ready = prepare(spec, dataset)
    problem = Problem(ready.model, ready.stages[0].recordings, THREE, base_genome(ready.model))
    *_, last = one_blas_thread(lambda: list(iterate(problem, Here(), truth.as_dict())))()
    done = whole[-1].checkpoint["ends"]["done"]
    assert min(end["cost"] for end in done) == pytest.approx(last.cost, abs=AGREE)
    for name in THREE:
        assert whole[-1].genome[name] == pytest.approx(last.values[name], rel=0.02), name
    progress_is_sound(whole)
    for cut in range(1, len(whole), 4):
        checkpoint = json.loads(json.dumps(whole[cut - 1].checkpoint, allow_nan=False))
        assert list(calibrate(spec, dataset, Here(), checkpoint)) == whole[cut:]


def test_auto_finishes_each_stage_of_a_staged_calibration(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    spec = replace(SEARCH, genes=THREE, method="auto", max_generations=2, population=8)
    whole = list(calibrate(spec, dataset, Here()))
    stages = ["structure", "structure, Gauss-Newton", "aerodynamics", "aerodynamics, Gauss-Newton"]
    assert list(dict.fromkeys(g.stage for g in whole)) == stages
    for stage in stages:
        assert [g.index for g in whole if g.stage == stage] == list(range(sum(g.stage == stage for g in whole)))
    last = next(g for g in reversed(whole) if g.stage == stages[1])
    assert {n: whole[-1].genome[n] for n in THREE[:2]} == {n: last.genome[n] for n in THREE[:2]}
    assert list(whole[-1].checkpoint["found"]) == ["structure", "aerodynamics"]
    progress_is_sound(whole)


@pytest.mark.parametrize(("mode", "drag"), [("local", 2.0), ("joint", 2.5)])
def test_auto_fits_a_vehicle(forces: Dataset, mode: Any, drag: float) -> None:
    """Here nowhere worse than Gauss-Newton alone; better where each of two recordings, fitted together, has its valley.

    That is so with this drag, fixed and not the true one. With 1.5, it ends in the worse valley; with
    free drag, one valley leads to the other.
    """
    fixed = {"C_D0": 0.0, "C_Dpi2": drag}
    spec = CalibrationSpec(method="auto", mode=mode, population=8, axes=("x", "z"), fixed=fixed)
    whole = list(calibrate(spec, forces, Here()))
    alone = list(calibrate(replace(spec, method="gauss_newton"), forces, Here()))
    names = [r.name for r in forces.fitted] if mode == "local" else ["joint"]
    assert list(dict.fromkeys(g.stage for g in whole)) == [f"{n}{e}" for n in names for e in ("", ", Gauss-Newton")]
    assert list(whole[-1].checkpoint["found"]) == names
    ready, (found, other) = prepare(spec, forces), (g[-1].checkpoint["found"] for g in (whole, alone))
    gains = [cost(ready, other[name], k) - cost(ready, found[name], k) for k, name in enumerate(names)]
    assert all(gain > -AGREE for gain in gains)
    assert mode == "local" or gains[0] > 100 * AGREE
    for truth, genome in zip(FORCE_TRUTHS, found.values(), strict=False):
        assert mode == "joint" or {n: genome[n] for n in truth} == pytest.approx(truth, rel=0.05)
    progress_is_sound(whole)
    for cut in (4, len(whole) // 2, len(whole) - 2):
        checkpoint = json.loads(json.dumps(whole[cut - 1].checkpoint, allow_nan=False))
        assert list(calibrate(spec, forces, Here(), checkpoint)) == whole[cut:]
