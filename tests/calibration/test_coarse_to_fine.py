"""A search with one discretisation of the wing, and Gauss-Newton with another (``search_division``)."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tests.calibration.test_search import THREE, Here, refused
from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.estimates.uncertainty import gene_errors
from wingfit.calibration.evaluator import as_batch
from wingfit.calibration.preparation import prepare
from wingfit.calibration.problem import Evaluation, Problem, base_genome
from wingfit.calibration.search import CalibrationSpec, Generation, calibrate
from wingfit.calibration.spec import SearchDivisionError
from wingfit.calibration.starts import AGREE
from wingfit.diagnosis.diagnose import check
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.records import Dataset, Genome
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.wing.flexible_wing import FlexibleWing

COARSE, FINE = "2x1", "4"
SPEC = CalibrationSpec(
    division=FINE, search_division=COARSE, mode="joint", method="auto", genes=THREE, population=12, max_generations=3,
    seed=7,
)  # fmt: skip


class Counting(Here):
    """Counts the individuals simulated with each discretisation."""

    def __init__(self) -> None:
        super().__init__()
        self.by_division: dict[str, int] = {}

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        assert isinstance(problem.model, FlexibleWing)
        division = problem.model.division
        self.by_division[division] = self.by_division.get(division, 0) + len(as_batch(values))
        return super().evaluate(problem, values, residuals=residuals)


def ran(spec: CalibrationSpec, dataset: Dataset) -> tuple[list[Generation], list[dict[str, int]]]:
    """All generations, and how many individuals each discretisation had simulated after each of them."""
    evaluator, whole, counts = Counting(), list[Generation](), list[dict[str, int]]()
    for generation in calibrate(spec, dataset, evaluator):
        whole.append(generation)
        counts.append(dict(evaluator.by_division))
    assert whole[-1].evaluations == evaluator.individuals
    return whole, counts


def resumes(spec: CalibrationSpec, dataset: Dataset, whole: list[Generation]) -> None:
    """Taken up after any generation, the next is the same to the bit, with its checkpoint; so all later ones are."""
    for before, after in pairwise(whole):
        checkpoint = json.loads(json.dumps(before.checkpoint, allow_nan=False))
        assert next(calibrate(spec, dataset, Here(), checkpoint)) == after
    assert not list(calibrate(spec, dataset, Here(), whole[-1].checkpoint))


def test_the_genes_are_the_same_in_every_discretisation(small: tuple[Dataset, Genome]) -> None:
    """Names, nominal values, bounds and scales, also those of all effects; so a search may hand over its values."""
    dataset, _ = small
    effects = tuple(name for name, effect in EFFECTS.items() if effect.applies_to(dataset.wing))
    assert len(effects) > 20
    of_each = {d: FlexibleWing(dataset.wing, d, effects=effects).genes for d in (COARSE, "4", "11", "24", "6x4")}
    assert set(of_each.values()) == {of_each["11"]}


def test_auto_ends_at_the_minimum_of_the_fine_wing(small: tuple[Dataset, Genome]) -> None:
    """Where Gauss-Newton ends that starts at the truth; the coarse wing, alone, ends elsewhere. Resumes everywhere."""
    dataset, truth = small
    whole, counts = ran(SPEC, dataset)
    ready = prepare(SPEC, dataset)
    problem = Problem(ready.model, ready.stages[0].recordings, THREE, base_genome(ready.model))
    *_, last = one_blas_thread(lambda: list(iterate(problem, Here(), truth.as_dict())))()
    costs = [end["cost"] for end in whole[-1].checkpoint["ends"]["done"]]
    assert min(costs) == pytest.approx(last.cost, abs=AGREE)
    errors = gene_errors(replace(problem, base=problem.base.replace(last.values)), Here()).standing
    for name in THREE:
        assert abs(whole[-1].genome[name] - last.values[name]) < errors[name].absolute, name
    searched = whole[2].genome
    assert any(abs(searched[name] - last.values[name]) > 3 * errors[name].absolute for name in THREE)
    assert [g.stage for g in whole[:4]] == ["joint"] * 3 + ["joint, Gauss-Newton"]
    assert counts[:3] == [{COARSE: 12}, {COARSE: 24}, {COARSE: 36}]
    assert {count[COARSE] for count in counts[3:]} == {36}
    assert all(a.get(FINE, 0) < b[FINE] for a, b in pairwise(counts[2:]))
    assert all(a.progress <= b.progress for a, b in pairwise(whole))
    assert whole[-1].progress == 1
    resumes(SPEC, dataset, whole)


@pytest.mark.parametrize("method", ["genetic", "cma_es"])
def test_finishing_starts_at_the_coarse_optimum_and_ends_at_the_fine_one(
    small: tuple[Dataset, Genome], method: Any
) -> None:
    """What is reported of a generation is that of its own model, and the first iteration may be worse than the search.

    Staged, so that each stage searches coarse and ends fine.
    """
    dataset, _ = small
    spec = replace(SPEC, method=method, finish=True, mode="staged", max_generations=2)
    whole, counts = ran(spec, dataset)
    stages = ["structure", "structure, Gauss-Newton", "aerodynamics", "aerodynamics, Gauss-Newton"]
    assert list(dict.fromkeys(g.stage for g in whole)) == stages
    ready = prepare(spec, dataset)
    assert isinstance(ready.search_model, FlexibleWing)
    assert isinstance(ready.model, FlexibleWing)
    assert (ready.model.division, ready.search_model.division) == (FINE, COARSE)
    for before, after, spent, then in zip(whole, whole[1:], counts, counts[1:], strict=False):
        grown = {name for name in then if then[name] > spent.get(name, 0)}
        assert grown == {FINE if after.stage.endswith("Gauss-Newton") else COARSE}
        assert after.progress >= before.progress
    for generation in whole:
        stage = next(one for one in ready.stages if generation.stage.startswith(one.name))
        model = ready.model if generation.stage.endswith("Gauss-Newton") else ready.search_model
        problem = Problem(model, stage.recordings, stage.free, base_genome(model, generation.genome))
        seen = Here().evaluate(problem, np.array([[generation.genome[name] for name in stage.free]]))
        assert generation.best == pytest.approx(seen.fitness[0], rel=0.01)
    resumes(spec, dataset, whole)


def test_a_start_that_the_fine_wing_cannot_take_is_reported_with_a_remedy(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small

    class Fragile(Here):
        """Fails every individual of the fine wing."""

        def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
            found = super().evaluate(problem, values, residuals=residuals)
            if problem.model.division == COARSE:  # type: ignore[attr-defined]
                return found
            reasons = ("broken",) * len(as_batch(values))
            return Evaluation(tuple(replace(part, reasons=reasons) for part in found.per_recording))

    spec = replace(SPEC, method="genetic", finish=True, max_generations=1)
    said = (
        r"division '4' cannot start at the best of the search with search_division '2x1': .*broken.*use method 'auto'"
    )
    with pytest.raises(ValueError, match=said):
        list(calibrate(spec, dataset, Fragile()))


def test_off_by_default_and_the_same_division_changes_nothing(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    off = replace(SPEC, search_division=None, method="genetic", finish=True, max_generations=1, genes=("E_r",))
    assert CalibrationSpec().search_division is None
    assert prepare(off, dataset).search_model is None
    whole = list(calibrate(off, dataset, Here()))
    assert list(calibrate(replace(off, search_division=FINE), dataset, Here())) == whole


def test_what_does_not_fit_is_refused_with_value_and_remedy(small: tuple[Dataset, Genome], forces: Dataset) -> None:
    dataset, _ = small
    what = "search_division '2x1'"
    refused(
        replace(SPEC, mode=None), forces, f"{what} is a discretisation of a wing.*describes a vehicle; leave it out"
    )
    refused(
        replace(SPEC, method="gauss_newton"), dataset, f"{what}.*'gauss_newton' has none; use method 'auto', or leave"
    )
    for method in (None, "genetic", "cma_es"):
        spec = replace(SPEC, method=method)
        refused(
            spec, dataset, f"{what} with method '{method or 'genetic'}'.*division '4'; add finish.*use method 'auto'"
        )
        assert prepare(replace(spec, finish=True), dataset).search_model
    for wrong in ("banana", "7", "", "65x1"):
        refused(
            replace(SPEC, search_division=wrong), dataset, f"search_division: division '{wrong}' is not valid; give"
        )
        with pytest.raises(SearchDivisionError):
            prepare(replace(SPEC, search_division=wrong), dataset)


def test_a_diagnosis_of_a_run_does_without(small: tuple[Dataset, Genome]) -> None:
    """It searches nothing, and takes the settings of any run."""
    dataset, _ = small
    check(dataset, DiagnosisSpec(calibration=replace(SPEC, method="gauss_newton")))
    check(dataset, DiagnosisSpec(calibration=SPEC))
