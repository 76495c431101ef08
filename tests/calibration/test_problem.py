"""Misfits: an individual's numbers are its own."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.calibration.evaluator import Unit, run_unit
from wingfit.calibration.problem import Misfit, Problem, base_genome
from wingfit.calibration.search import CalibrationSpec, model_for, prepare
from wingfit.records import Dataset, Genome


def row(part: Misfit, k: int) -> tuple[bytes, bytes, bytes]:
    assert part.residuals is not None
    return part.squares[k].tobytes(), part.distance[k].tobytes(), part.residuals[k].tobytes()


@pytest.mark.parametrize("kind", ["tracks", "forces"])
def test_an_individual_has_the_same_bits_alone_and_anywhere_in_a_batch(
    small: tuple[Dataset, Genome], forces: Dataset, kind: str
) -> None:
    dataset = small[0] if kind == "tracks" else forces
    spec = CalibrationSpec(division="4")
    model, stage = model_for(dataset, spec), prepare(spec, dataset).stages[0]
    problem = Problem(model, stage.recordings, stage.free, base_genome(model), spec.axes)
    genes = [gene for gene in model.genes if gene.name in stage.free]
    unit = np.random.default_rng(0).uniform(0.3, 0.7, (8, len(genes)))
    values = np.array([[float(gene.from_unit(u)) for gene, u in zip(genes, one, strict=True)] for one in unit])
    together = run_unit(problem, values, Unit(0, 8, 0), residuals=True)
    backwards = run_unit(problem, values[::-1], Unit(0, 8, 0), residuals=True)
    assert np.isfinite(together.squares).all()
    for k in range(8):
        alone = run_unit(problem, values, Unit(k, k + 1, 0), residuals=True)
        assert row(alone, 0) == row(together, k) == row(backwards, 7 - k)
