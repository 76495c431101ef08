"""A problem made linear about a genome by finite differences, all neighbours in one batch.

Coordinates are the genes' unit coordinates (:meth:`wingfit.records.Gene.to_unit`): logarithmic for a log gene, the box
[0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.inference.differences import STEP, Outputs, differences
from wingfit.records import Gene
from wingfit.records.array_types import Array, Mask

AT_BOUND = 1e-6  # in unit coordinates
SHORTER = 0.125  # of the step, where both neighbours fail


@dataclass(frozen=True)
class Linearised:
    """Residuals r(u + d) = r + S d of a problem about unit coordinates u.

    Attributes:
        residuals: per recording [T, C], simulated minus recorded, NaN where not compared.
        sensitivities: per recording S = dr/du, [T, C, F]; zero for a gene that could not be differentiated.
        known: [F], False for a gene that could not be differentiated because both of its neighbours fail.
        fitness: sum of squares at u (:attr:`wingfit.calibration.problem.Evaluation.fitness`).
        distance: misfit at u, m or N.
        evaluations: individuals evaluated.
        reasons: why neighbours failed.
    """

    residuals: tuple[Array, ...]
    sensitivities: tuple[Array, ...]
    known: Mask
    fitness: float
    distance: float
    evaluations: int
    reasons: tuple[str, ...]


def free_genes(problem: Problem) -> list[Gene]:
    """The free genes, in the order of the columns of a batch."""
    genes = {gene.name: gene for gene in problem.model.genes}
    return [genes[name] for name in problem.free]


def values_at(genes: list[Gene], unit: Array) -> Array:
    """Values [B, F] at unit coordinates [B, F]."""
    return np.stack([gene.from_unit(column) for gene, column in zip(genes, unit.T, strict=True)], axis=1)


def unit_at(genes: list[Gene], values: Array) -> Array:
    """Unit coordinates [F] of values [F], inside the box."""
    return np.clip([float(gene.to_unit(value)) for gene, value in zip(genes, values, strict=True)], 0.0, 1.0)


def stopped(genes: list[Gene], values: Array) -> Mask:
    """Array [F], True where the value [F] lies at a bound of its gene."""
    unit = unit_at(genes, values)
    return np.asarray((unit < AT_BOUND) | (unit > 1 - AT_BOUND))


def residuals_of(evaluation: Evaluation) -> list[Array]:
    """Residuals [B, T, C] of each recording."""
    parts = [part.residuals for part in evaluation.per_recording]
    if any(part is None for part in parts):
        raise TypeError("the evaluator returned no residuals although they were requested")
    return [part for part in parts if part is not None]


def linearise(problem: Problem, evaluator: Evaluator, unit: Array) -> Linearised:
    """Central differences about ``unit`` [F]; ValueError when the genome there cannot be simulated.

    Steps that would leave the box end at its edge, and a neighbour that fails is replaced by the base, so that
    differences may become one-sided. Where both fail, shorter steps are tried once.
    """
    genes, evaluations = free_genes(problem), list[Evaluation]()

    def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        evaluation = evaluator.evaluate(problem, values_at(genes, units), residuals=True)
        evaluations.append(evaluation)
        return residuals_of(evaluation), evaluation.reasons

    found = differences(simulate, unit, np.arange(len(unit)))
    failed = np.flatnonzero(~found.known)
    if len(failed):
        again = differences(simulate, unit, failed, at=found.outputs, step=STEP * SHORTER)
        found.known[failed] = again.known
        for slopes, new in zip(found.slopes, again.slopes, strict=True):
            slopes[..., failed] = new
    return Linearised(
        found.outputs,
        found.slopes,
        found.known,
        float(evaluations[0].fitness[0]),
        float(evaluations[0].distance[0]),
        sum(len(evaluation.fitness) for evaluation in evaluations),
        tuple(reason for evaluation in evaluations for reason in evaluation.reasons if reason),
    )
