"""Linearises a problem about a genome: by the derivatives of the computed motion, else by finite differences.

Either way all displaced genomes are simulated in one batch.

The variables are the genes in unit coordinates (:meth:`wingfit.records.Gene.to_unit`): scaled so that their bounds are
0 and 1, logarithmically for a log-scaled gene.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.inference.differences import STEP, Outputs, Simulate, derivatives, with_more
from wingfit.records import Gene
from wingfit.records.array_types import Array, Mask
from wingfit.sim.model import DifferentiableModel

AT_BOUND = 1e-6  # in unit coordinates
SHORTER = 0.125  # of the step, where both neighbours fail
SAME_MOTION_DISTANCE = 0.05  # in unit coordinates: an initial motion of genes this near is reused


@dataclass(frozen=True)
class Linearised:
    """Linear model r(u + d) = r + S d of the residuals of a problem for genes u + d near u, scaled to 0..1.

    Attributes:
        residuals: r for each recording, [T, C] simulated minus recorded, m or N; NaN where not compared.
        sensitivities: S = dr/du for each recording, [T, C, F]; zero for a gene that could not be differentiated.
        known: [F], False for a gene that could not be differentiated because the genomes on both sides fail.
        fitness: sum of squares at u (:attr:`wingfit.calibration.problem.Evaluation.fitness`).
        distance: misfit at u, m or N.
        evaluations: individuals simulated.
        reasons: why displaced genomes failed.
    """

    residuals: tuple[Array, ...]
    sensitivities: tuple[Array, ...]
    known: Mask
    fitness: float
    distance: float
    evaluations: int
    reasons: tuple[str, ...]


def free_genes(problem: Problem) -> list[Gene]:
    """Return the free genes of ``problem``, in the order of the columns of a batch."""
    genes = {gene.name: gene for gene in problem.model.genes}
    return [genes[name] for name in problem.free]


def values_at(genes: list[Gene], unit: Array) -> Array:
    """Return the values [B, F] of the F ``genes`` for B individuals ``unit`` [B, F], genes scaled to 0..1."""
    return np.stack([gene.from_unit(column) for gene, column in zip(genes, unit.T, strict=True)], axis=1)


def unit_at(genes: list[Gene], values: Array) -> Array:
    """Return the genes scaled to 0..1 [F] of their ``values`` [F]; a value outside its bounds counts as the bound."""
    return np.clip([float(gene.to_unit(value)) for gene, value in zip(genes, values, strict=True)], 0.0, 1.0)


def stopped(genes: list[Gene], values: Array) -> Mask:
    """Return True [F] for each gene whose value in ``values`` [F] lies at one of its bounds."""
    unit = unit_at(genes, values)
    return np.asarray((unit < AT_BOUND) | (unit > 1 - AT_BOUND))


def residuals_of(evaluation: Evaluation) -> list[Array]:
    """Return the residuals [B, T, C] (B individuals) of each recording; TypeError if the evaluator returned none."""
    parts = [part.residuals for part in evaluation.per_recording]
    if any(part is None for part in parts):
        raise TypeError("the evaluator returned no residuals although they were requested")
    return [part for part in parts if part is not None]


def initial_motion(before: Array, unit: Array) -> Array:
    """Return the genes [F], scaled to 0..1, from whose motion simulations near ``unit`` [F] start.

    Those are ``before`` [F], from whose motion earlier simulations started, as long as they are near.
    """
    return before if np.abs(unit - before).max() <= SAME_MOTION_DISTANCE else unit


def beside_problem(problem: Problem, values: Array) -> Problem:
    """Return ``problem`` with simulations that start from the motion at ``values`` [F] of the free genes."""
    if not isinstance(problem.model, DifferentiableModel):
        return problem
    return replace(problem, model=problem.model.beside(problem.genomes(values)[0]))


def tangent_problem(problem: Problem, values: Array) -> Problem | None:
    """Return ``problem`` for batches of neighbours; None if it has no derivatives (:class:`DifferentiableModel`).

    ``values`` [F] of the free genes: close to those of the batches.
    """
    if not isinstance(problem.model, DifferentiableModel):
        return None
    return replace(problem, model=problem.model.tangent(problem.genomes(values)[0]))


def linearise(problem: Problem, evaluator: Evaluator, unit: Array, motion: Array | None = None) -> Linearised:
    """Linearise about ``unit`` [F], genes scaled to 0..1.

    ``motion`` [F]: genes from whose motion derivatives start (:func:`initial_motion`); None: ``unit``.
    NotSimulatedError if the genome at ``unit`` cannot be simulated. A model that is differentiable is differentiated in
    steps of TANGENT_STEP; for the genes that have no derivative, and for other models, central differences are taken.
    Their steps end at the bounds, and a displaced genome that fails is replaced by the one at ``unit``, so that
    differences may become one-sided. For genes with a failure on both sides, shorter steps are tried once.
    """
    genes, evaluations, every = free_genes(problem), list[Evaluation](), np.arange(len(unit))

    def simulated_by(problem: Problem) -> Simulate:
        def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
            evaluation = evaluator.evaluate(problem, values_at(genes, units), residuals=True)
            evaluations.append(evaluation)
            return residuals_of(evaluation), evaluation.reasons

        return simulate

    near = unit if motion is None else motion
    simulate, tangent = simulated_by(problem), tangent_problem(problem, values_at(genes, near[None])[0])
    found = derivatives(simulate, simulated_by(tangent) if tangent else None, unit, every)
    found = with_more(found, simulate, unit, every, step=STEP * SHORTER)
    # The first batch begins with the point itself; if it cannot be differentiated, so does the second.
    base = next(evaluation for evaluation in evaluations if evaluation.reasons[0] is None)
    return Linearised(
        found.outputs,
        found.slopes,
        found.known,
        float(base.fitness[0]),
        float(base.distance[0]),
        sum(len(evaluation.fitness) for evaluation in evaluations),
        found.reasons,
    )
