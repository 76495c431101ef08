"""Maximum-likelihood estimation (Armanini et al. 2016, Eq. 22) with any model: damped Gauss-Newton within gene bounds.

The cost is J = 1/2 sum_i v_i^T R^-1 v_i + N/2 ln det R + N n_y/2 ln 2 pi: v_i residuals [n_y] of sample i of N, R their
covariance. R is estimated anew in each iteration and constant while the genes move (relaxation). A step solves the
linearised problem within the bounds (active-set bounded least squares) for several Levenberg-Marquardt dampings at
once; the best of the resulting genomes is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from wingfit.calibration.effects import is_size
from wingfit.calibration.estimates.linearised import (
    Linearised,
    beside_problem,
    free_genes,
    initial_motion,
    linearise,
    residuals_of,
    stopped,
    unit_at,
    values_at,
)
from wingfit.calibration.estimates.uncertainty import Uncertainty, uncertainty
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.initial_effect_position import placed
from wingfit.calibration.problem import Problem
from wingfit.inference.gauss_newton import Quadratic, Trials
from wingfit.inference.noise.white import Noise, whitened_sensitivity
from wingfit.records import Gene
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread

# Dampings tried at once, times the last successful one: two groups of lanes, with the present genome. Near 1 they lie
# densely, because valleys of stiffnesses that compensate each other bend: a damping three times too small leaves the
# valley, one three times too large makes tiny steps.
DAMPINGS = 10.0 ** np.array([-4, -3, -2, -1.5, -1, -0.75, -0.5, -0.25, 0, 0.25, 0.5, 0.75, 1, 1.5, 3])
FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-4, 1e6  # of each gene's curvature
LEAST_CURVATURE = 4.0  # that of a prior with half the range as standard deviation: an unidentifiable gene stays
LEAST_GAIN = 1e-3  # of the decrease that the linearised problem predicts
STEP = 1e-3  # unit coordinates
COST = 1e-5  # of J's 1/2 sum v^T R^-1 v, which is half the number of samples
ITERATIONS = 50


@dataclass(frozen=True)
class Step:
    """Progress after one iteration; the estimation can be resumed from its ``checkpoint`` (JSON).

    Attributes:
        index: number of the iteration, from 0.
        values: of the free genes after the iteration, by name.
        cost: J of Eq. 22 before the iteration, with the R estimated in it.
        fitness: sum of squares after the iteration (:attr:`wingfit.calibration.problem.Misfit.squares`).
        distance: misfit after the iteration, m or N.
        step: largest move of a gene, genes scaled to 0..1.
        gain: decrease of the cost, divided by the decrease that the linearised problem predicts; 0 if no step lowers
            the cost.
        evaluations: individuals simulated in the iteration.
        reasons: why individuals failed.
        converged: whether this is the last iteration.
        flat: decrease of the cost that counts as none; the ends of two estimations may differ by a few times as much.
    """

    index: int
    values: dict[str, float]
    cost: float
    fitness: float
    distance: float
    step: float
    gain: float
    evaluations: int
    reasons: tuple[str, ...]
    converged: bool
    checkpoint: dict[str, Any]
    flat: float = 0.0


@dataclass(frozen=True)
class Estimate:
    """A maximum-likelihood estimate: final ``values`` of the ``free`` genes, and their uncertainty.

    ``evaluations`` counts simulated individuals; ``remarks`` are warnings, such as genes at a bound.
    """

    free: tuple[str, ...]
    values: dict[str, float]
    iterations: int
    evaluations: int
    converged: bool
    remarks: tuple[str, ...]
    uncertainty: Uncertainty


@dataclass(frozen=True)
class _State:
    """State between iterations: genes ``unit`` (scaled to 0..1), damping, and number of the last iteration.

    ``motion``: genes (scaled to 0..1) whose periodic motion is the initial motion of simulations. ``flat`` counts the
    last successive iterations that lowered the cost by at most the fraction COST.
    """

    unit: tuple[float, ...]
    motion: tuple[float, ...]
    damping: float = FIRST_DAMPING
    index: int = -1
    flat: int = 0
    converged: bool = False

    @classmethod
    def resumed(cls, checkpoint: dict[str, Any]) -> _State:
        """Return the state of a ``checkpoint``; an old one without a motion goes on from that of its genes."""
        unit = tuple(checkpoint["unit"])
        return cls(**(checkpoint | {"unit": unit, "motion": tuple(checkpoint.get("motion", unit))}))

    def saved(self) -> dict[str, Any]:
        """Return the state as a checkpoint (JSON)."""
        return asdict(self) | {"unit": list(self.unit), "motion": list(self.motion)}


@dataclass(frozen=True)
class _Move:
    """The outcome of one iteration: the best step or, if no step lowers the cost, the unchanged genome with gain 0.

    ``unit`` [F]: genes after it, scaled to 0..1; ``step``: largest move of a gene; ``decrease`` of the cost;
    ``gain``: ``decrease`` divided by the predicted one; ``fitness``, ``distance``: misfit after it.
    """

    unit: Array
    step: float
    gain: float
    decrease: float
    damping: float
    fitness: float
    distance: float
    evaluations: int
    reasons: tuple[str, ...]


@one_blas_thread
def iterate(
    problem: Problem,
    evaluator: Evaluator,
    start: Mapping[str, float],
    checkpoint: dict[str, Any] | None = None,
    iterations: int = ITERATIONS,
) -> Iterator[Step]:
    """Yield Gauss-Newton iterations from ``start`` (missing genes: from the base) or, if given, from ``checkpoint``.

    Ends when no step lowers the cost, when a step is smaller than STEP and lowers the cost by less than the fraction
    COST, when two steps in succession lower it by less (genes that still move are then not identifiable), or after
    ``iterations``. A resumed estimation gives the same bits as an uninterrupted one. NotSimulatedError if the start
    cannot be simulated. An effect of size zero starts with this size; its other genes start with the values that
    :mod:`wingfit.calibration.initial_effect_position` chooses.
    """
    genes, before = free_genes(problem), 0
    if checkpoint is None:
        first = unit_at(genes, np.array([start.get(gene.name, problem.base[gene.name]) for gene in genes]))
        first, before = placed(problem, evaluator, first)
        state = _State(tuple(first.tolist()), tuple(first.tolist()))
    else:
        state = _State.resumed(checkpoint)
    while not state.converged and state.index + 1 < iterations:
        step, state = _iteration(problem, evaluator, genes, state)
        yield replace(step, evaluations=step.evaluations + before)
        before = 0


@one_blas_thread
def estimate(problem: Problem, evaluator: Evaluator, start: Mapping[str, float]) -> Estimate:
    """Iterate from ``start`` (values by name) to convergence, and estimate the uncertainty of the result."""
    evaluations, last = 0, None
    for last in iterate(problem, evaluator, start):
        evaluations += last.evaluations
    if last is None:
        raise ValueError("an estimate needs at least one iteration")
    known = uncertainty(replace(problem, base=problem.base.replace(last.values)), evaluator)
    unfinished = f"not converged after {last.index + 1} iterations; the last moved {last.step:.2g}"
    remarks = *at_bounds(free_genes(problem), last.values), *known.remarks
    return Estimate(
        free=problem.free,
        values=last.values,
        iterations=last.index + 1,
        evaluations=evaluations,
        converged=last.converged,
        remarks=remarks if last.converged else (unfinished, *remarks),
        uncertainty=known,
    )


def at_bounds(genes: list[Gene], values: Mapping[str, float]) -> tuple[str, ...]:
    """Return remarks on genes whose ``values`` (by name) are at a bound, except sizes of zero (effect is off)."""
    genes = [gene for gene in genes if values[gene.name] != 0.0 or not is_size(gene.name)]
    found = np.array([values[gene.name] for gene in genes])
    return tuple(
        f"{gene.name} is at its {'lower' if value <= gene.lower else 'upper'} bound {value:.4g}: the best value may "
        "lie beyond; the standard errors of the other genes hold for this value"
        for gene, value, at_bound in zip(genes, found, stopped(genes, found), strict=True)
        if at_bound
    )


def _iteration(problem: Problem, evaluator: Evaluator, genes: list[Gene], state: _State) -> tuple[Step, _State]:
    unit, motion = np.array(state.unit), np.array(state.motion)
    problem = beside_problem(problem, values_at(genes, motion[None])[0])
    linear = linearise(problem, evaluator, unit, motion)
    noise = Noise.of_each(problem.recordings, linear.residuals)
    quadratic, power = _quadratic(noise, linear)
    move = _better(problem, evaluator, unit, noise, quadratic, power, state.damping)
    stays = move.gain == 0.0
    little = COST * 0.5 * power
    flat = state.flat + 1 if move.decrease <= little else 0
    converged = stays or (flat > 0 and move.step <= STEP) or flat > 1
    motion = initial_motion(motion, move.unit)
    after = _State(tuple(move.unit.tolist()), tuple(motion.tolist()), move.damping, state.index + 1, flat, converged)
    step = Step(
        index=after.index,
        values=dict(zip(problem.free, values_at(genes, move.unit[None])[0].tolist(), strict=True)),
        cost=float(sum(n.cost(v) for n, v in zip(noise, linear.residuals, strict=True))),
        fitness=linear.fitness if stays else move.fitness,
        distance=linear.distance if stays else move.distance,
        step=move.step,
        gain=move.gain,
        evaluations=linear.evaluations + move.evaluations,
        reasons=(*linear.reasons, *move.reasons),
        converged=converged,
        checkpoint=after.saved(),
        flat=little,
    )
    return step, after


def _better(
    problem: Problem,
    evaluator: Evaluator,
    unit: Array,
    noise: list[Noise],
    quadratic: Quadratic,
    power: float,
    damping: float,
) -> _Move:
    """Try steps with dampings around ``damping``, and return the best that lowers the cost; no move if none does.

    Larger dampings are tried until one succeeds or they reach a limit. ``unit`` [F]: present genes, scaled to
    0..1. ``quadratic``: second-order model of the cost there; ``power``: sum of v^T R^-1 v there (v residuals, R
    covariance in ``noise``), which counts if the present genome fails from the initial motion of the trials.
    """
    genes, evaluations, reasons = free_genes(problem), 0, list[str]()
    while True:
        dampings, scale = damping * DAMPINGS, np.diag(quadratic.curvature) + LEAST_CURVATURE
        steps = np.array([quadratic.step(unit, one * scale) for one in dampings])
        units = np.clip(unit + steps, 0.0, 1.0)
        # The present genome is simulated again, in the same way: errors of the solver must not look like a decrease.
        every = values_at(genes, np.vstack([units, unit]))
        evaluation = evaluator.evaluate(problem, every, residuals=True)
        after = np.zeros(len(every))
        for n, part in zip(noise, residuals_of(evaluation), strict=True):
            after += 0.5 * (n.whitened(part) ** 2).sum(axis=(1, 2))
        now = float(after[-1]) if evaluation.reasons[-1] is None else 0.5 * power
        trials = Trials.of(units, quadratic.decrease(steps), now, after[:-1], evaluation.reasons[:-1])
        evaluations += len(every)
        reasons += [reason for reason in evaluation.reasons if reason]
        k = trials.best(LEAST_GAIN)
        if k is not None:
            return _Move(
                trials.units[k],
                float(np.abs(steps[k]).max()),
                trials.gain(k),
                float(trials.decrease[k]),
                float(max(dampings[k], LEAST_DAMPING)),
                float(evaluation.fitness[k]),
                float(evaluation.distance[k]),
                evaluations,
                tuple(reasons),
            )
        if dampings[-1] >= LARGEST_DAMPING or np.abs(steps).max() <= STEP:
            return _Move(unit, 0.0, 0.0, 0.0, damping, np.inf, np.inf, evaluations, tuple(reasons))
        damping = float(dampings[-1] / DAMPINGS[0])


def _quadratic(noise: list[Noise], linear: Linearised) -> tuple[Quadratic, float]:
    """Return the second-order model of the cost at the point of ``linear``, and the sum of v^T R^-1 v there."""
    white = [n.whitened(v).ravel() for n, v in zip(noise, linear.residuals, strict=True)]
    steep = [
        whitened_sensitivity(n, s).reshape(-1, s.shape[-1]) for n, s in zip(noise, linear.sensitivities, strict=True)
    ]
    return Quadratic.of(list(zip(white, steep, strict=True))), float(sum(v @ v for v in white))
