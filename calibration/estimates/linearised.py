"""A problem made linear about a genome by finite differences, all neighbours in one batch.

Coordinates are the genes' unit coordinates (:meth:`wingfit.records.Gene.to_unit`): logarithmic for a log gene, the box
[0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.records import Gene

Array = npt.NDArray[np.float64]

# In unit coordinates; 1 % of a gene whose box is the thesis's. Simulated motions carry an error of some hundredths of a
# millimetre that differs from one neighbour to the next; much smaller steps would measure it, larger ones the
# curvature (docs/estimation.md has the figures).
STEP = 0.003
AT_BOUND = 1e-6  # in unit coordinates
SHORTER = 0.125  # of the step, where both neighbours fail


@dataclass(frozen=True)
class Linearised:
    """Residuals r(u + d) = r + S d of a problem about unit coordinates u.

    Attributes:
        residuals: per recording [T, C], simulated minus recorded, NaN where not compared.
        sensitivities: per recording S = dr/du, [T, C, F]; zero for a gene that is not told.
        told: [F], False for a gene both of whose neighbours fail.
        fitness: sum of squares at u (:attr:`wingfit.calibration.problem.Evaluation.fitness`).
        distance: misfit at u, m or N.
        evaluations: individuals evaluated.
        reasons: why neighbours failed.
    """

    residuals: tuple[Array, ...]
    sensitivities: tuple[Array, ...]
    told: npt.NDArray[np.bool_]
    fitness: float
    distance: float
    evaluations: int
    reasons: tuple[str, ...]


def free_genes(problem: Problem) -> list[Gene]:
    """Genes of the free columns, in their order."""
    genes = {gene.name: gene for gene in problem.model.genes}
    return [genes[name] for name in problem.free]


def values_at(genes: list[Gene], unit: Array) -> Array:
    """Values [B, F] at unit coordinates [B, F]."""
    return np.stack([gene.from_unit(column) for gene, column in zip(genes, unit.T, strict=True)], axis=1)


def unit_at(genes: list[Gene], values: Array) -> Array:
    """Unit coordinates [F] of values [F], inside the box."""
    return np.clip([float(gene.to_unit(value)) for gene, value in zip(genes, values, strict=True)], 0.0, 1.0)


def stopped(genes: list[Gene], values: Array) -> npt.NDArray[np.bool_]:
    """[F], True where a value lies at a bound of its gene."""
    unit = unit_at(genes, values)
    return np.asarray((unit < AT_BOUND) | (unit > 1 - AT_BOUND))


def residuals_of(evaluation: Evaluation) -> list[Array]:
    """Residuals [B, T, C] of each recording."""
    parts = [part.residuals for part in evaluation.per_recording]
    if any(part is None for part in parts):
        raise TypeError("the evaluator returned no residuals although they were asked for")
    return [part for part in parts if part is not None]


def linearise(problem: Problem, evaluator: Evaluator, unit: Array) -> Linearised:
    """Central differences about ``unit`` [F]; ValueError when the genome there cannot be simulated.

    Steps that would leave the box end at its edge, and a neighbour that fails is replaced by the base, so that
    differences may become one-sided. Where both fail, shorter steps are tried once.
    """
    first = _differences(problem, evaluator, unit, STEP, np.ones(len(unit), bool))
    if first.told.all():
        return first
    again = _differences(problem, evaluator, unit, STEP * SHORTER, ~first.told)
    return Linearised(
        first.residuals,
        tuple(a + b for a, b in zip(first.sensitivities, again.sensitivities, strict=True)),
        first.told | again.told,
        first.fitness,
        first.distance,
        first.evaluations + again.evaluations,
        (*first.reasons, *again.reasons),
    )


def _differences(
    problem: Problem, evaluator: Evaluator, unit: Array, step: float, which: npt.NDArray[np.bool_]
) -> Linearised:
    """Differences for the genes ``which``; the others are given as not told, with sensitivities of zero."""
    (columns,), genes = np.nonzero(which), free_genes(problem)
    moves = step * np.eye(len(unit))[columns]
    neighbours = np.clip(np.vstack([unit[None], unit + moves, unit - moves]), 0.0, 1.0)
    evaluation = evaluator.evaluate(problem, values_at(genes, neighbours), residuals=True)
    if evaluation.reasons[0] is not None:
        raise ValueError(f"the genome to be differentiated cannot be simulated: {evaluation.reasons[0]}")
    good = np.array([reason is None for reason in evaluation.reasons])
    row = np.where(good, np.arange(len(good)), 0)
    up, down = row[1 : len(columns) + 1], row[len(columns) + 1 :]
    width = neighbours[up, columns] - neighbours[down, columns]
    told = np.zeros(len(unit), bool)
    told[columns] = width > 0
    residuals, sensitivities = [], []
    for part in residuals_of(evaluation):
        seen = np.isfinite(part[0])
        slope = np.zeros((*seen.shape, len(unit)))
        change = np.where(seen, part[up] - part[down], 0.0) / np.where(width > 0, width, 1.0)[:, None, None]
        slope[:, :, columns] = np.moveaxis(change, 0, -1)
        residuals.append(part[0])
        sensitivities.append(slope)
    return Linearised(
        tuple(residuals),
        tuple(sensitivities),
        told,
        float(evaluation.fitness[0]),
        float(evaluation.distance[0]),
        len(neighbours),
        tuple(reason for reason in evaluation.reasons if reason),
    )
