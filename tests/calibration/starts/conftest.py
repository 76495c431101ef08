"""A model of two valleys, and runs of the method auto on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tests.calibration.linear import Linear, blank
from tests.calibration.test_search import Here
from wingfit.calibration import search
from wingfit.calibration.estimates.likelihood import Step
from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.evaluator import as_batch
from wingfit.calibration.genetic import FAILED, Population
from wingfit.calibration.preparation import Prepared, Stage
from wingfit.calibration.problem import Evaluation, Problem, base_genome
from wingfit.calibration.search import CalibrationSpec, Generation, calibrate
from wingfit.calibration.starts import SEARCHED
from wingfit.records import Dataset
from wingfit.sim.model import Array, Observation

RIGHT, WRONG = 1.0, -1.0  # values of a near which the two minima of Valleys lie
NAMES = ("a", "c")


def population(unit: list[list[float]], failed: int = 0) -> Population:
    """The last generation of a search, with individuals ``unit``, of which the last ``failed`` have failed."""
    fitness = [1.0 + k for k in range(len(unit) - failed)] + [FAILED] * failed
    return Population(unit, fitness, list(fitness), SEARCHED - 1, 0, 1.0)


def step(cost: float, index: int = 0, *, converged: bool = True) -> Step:
    return Step(index, {"a": cost}, cost, 2 * cost, 3 * cost, 0.0, 1.0, 1, (), converged, {"index": index})


@dataclass(frozen=True)
class Valleys(Linear):
    """Forces with which a = RIGHT fits exactly, and near a = WRONG another minimum lies."""

    def observe(self, genomes: Array, recording: Any) -> Observation:
        a, _, c = np.asarray(genomes).T
        return super().observe(np.stack([a**2 - 1.0, 0.3 * (a - 1.0), c], axis=1), recording)


class Failing(Here):
    """Fails every individual whose a lies between ``bounds``."""

    def __init__(self, *bounds: float) -> None:
        super().__init__()
        self.bounds = bounds

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        found = super().evaluate(problem, values, residuals=residuals)
        a = as_batch(values)[:, problem.free.index("a")]
        off = (self.bounds[0] <= a) & (a <= self.bounds[1])
        parts = [
            replace(
                part,
                squares=np.where(off, np.inf, part.squares),
                reasons=tuple("broken" if o else r for o, r in zip(off, part.reasons, strict=True)),
            )
            for part in found.per_recording
        ]
        return Evaluation(tuple(parts))


@pytest.fixture
def valleys(monkeypatch: pytest.MonkeyPatch) -> Prepared:
    """A calibration of Valleys, which is what any dataset is prepared as."""
    model, empty = Valleys(), blank()
    truth = base_genome(model, {"a": RIGHT, "c": 1.5}).values
    noise = 0.003 * np.random.default_rng(1).normal(size=(len(empty.times), 1))
    record = replace(empty, values=model.observe(np.array([truth]), empty).channels[0] + noise)
    spec = CalibrationSpec(method="auto", mode="joint", population=8, seed=3)
    ready = Prepared(spec, model, (Stage("joint", NAMES, (record,)),), ())
    monkeypatch.setattr(search, "prepare", lambda *_: ready)
    return ready


def searched(ready: Prepared, *starts: float) -> dict[str, Any]:
    """A checkpoint as one of an earlier version, without ``ends``: the search has ended, at these values of a."""
    model = ready.model
    problem = Problem(model, ready.stages[0].recordings, NAMES, base_genome(model))
    unit = [unit_at(free_genes(problem), np.array([a, 0.0])).tolist() for a in starts]
    base = base_genome(model).as_dict()
    return {
        "stage": 0, "base": base, "population": vars(population(unit)), "evaluations": 64, "progress": 0.8,
        "found": {"joint": base}, "newton": None,
    }  # fmt: skip


def ran(ready: Prepared, dataset: Dataset, *starts: float, evaluator: Here | None = None) -> list[Generation]:
    return list(calibrate(ready.spec, dataset, evaluator or Here(), searched(ready, *starts)))


def progress_is_sound(whole: list[Generation]) -> None:
    *before, last = [one.progress for one in whole]
    assert last == 1
    assert all(a <= b for a, b in pairwise(before))
    assert before[-1] < 1
