"""What is fitted: settings beyond their limits are refused; an individual's numbers are its own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wingfit.calibration.evaluator import Unit, run_unit
from wingfit.calibration.problem import Misfit, Problem, base_genome
from wingfit.calibration.search import CalibrationSpec, model_for, prepare
from wingfit.records import Dataset, Genome

SPEC = CalibrationSpec(division="4", population=16, max_generations=4, seed=7)


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


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"population": 0}, "population is 0; it should be greater than or equal to 4"),
        ({"population": 2000}, "population is 2000; it should be less than or equal to 1000"),
        ({"population": 8.0}, "population is 8.0; it should be a whole number"),
        ({"max_generations": 0}, "max_generations is 0; it should be greater than or equal to 1"),
        ({"stall": 0}, "stall is 0; it should be greater than or equal to 1"),
        ({"tolerance": -5.0}, "tolerance is -5.0; it should be greater than or equal to 0"),
        ({"tolerance": float("nan")}, "tolerance is nan; it should be greater than or equal to 0"),
        ({"seed": -1}, "seed is -1; it should be greater than or equal to 0"),
        ({"bounds_factor": 1.0}, "bounds_factor is 1.0; it should be greater than or equal to 1.01"),
        ({"method": "auto", "finish": True}, "finish means nothing for the method auto"),
        ({"genes": ("E_f", "E_f")}, "gene 'E_f' is named 2 times; name it once"),
        ({"recordings": ("a", "a")}, "recording 'a' is named 2 times; name it once"),
    ],
)
def test_numbers_beyond_their_limits_and_repeated_names_are_refused(
    changes: dict[str, Any], match: str, small: tuple[Dataset, Genome]
) -> None:
    """As they are over HTTP."""
    with pytest.raises(ValueError, match=match):
        prepare(replace(SPEC, **changes), small[0])
