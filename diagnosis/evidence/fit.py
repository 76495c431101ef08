"""Fit genes to Fourier coefficients by Gauss-Newton steps within their bounds; the Jacobian is measured or updated.

A diagnosis fits a dozen models that differ from the nominal one by a few added genes. They take over its Jacobian; only
the columns of the added genes are measured by finite differences. Each step updates it (Broyden 1965); where it no
longer predicts what a step does, it is measured again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, initial_motion, tangent_problem, values_at
from wingfit.calibration.problem import Problem
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.inference.differences import Outputs, Simulate, derivatives
from wingfit.inference.gauss_newton import Quadratic, Trials
from wingfit.records.array_types import Array, Bool, Float, Mask

PRIOR_SD = 0.5  # standard deviation of a gene's prior, unit coordinates
# Dampings tried at once, as many as fill the lanes of the processor. Relative to each gene's own curvature (Marquardt
# 1963), about the last good factor, they suit genes that are identifiable one by one; equal for all genes (Levenberg
# 1944), they follow the curved valleys of stiffnesses that compensate each other.
DAMPING_FACTORS = (10.0 ** np.array([-4.0, -1.0, 0.0, 1.0]), 10.0 ** np.array([0.5, 2.0, 3.5, 5.0]))
FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-6, 1e4  # relative to each gene's curvature
SINGULAR = 1e-12  # of the largest curvature, added to every damping so that no curvature is singular
GOOD_STEP_RATIO = 0.6  # of the predicted decrease; below it the Jacobian is measured again
RELATIVE_TOLERANCE = 2e-3  # of the weighted chi-squared; a fit has converged where a step gains less
COST_TOLERANCE = 0.3  # least decrease of the cost that is worth another step
SLOW_FACTOR = 5.0  # times these: a step that gains less is slow, as the valley is curved or the Jacobian inexact
ACCELERATION_STEP = 0.02  # of the box: length along a step over which the second derivative is measured
FAILED_COEFFICIENT = 1e12  # coefficient of an individual that cannot be simulated


class InitialSimulationError(ValueError):
    """Raised where the model cannot be simulated at the start of a fit."""


FIT_ERRORS = (InitialSimulationError, np.linalg.LinAlgError)  # end one fit, not the diagnosis


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        problem: the model with its free genes.
        unit: [F] genes in unit coordinates (scaled so that their bounds are 0 and 1).
        coefficients: [D] Fourier coefficients of the residuals (:class:`WhitenedData`), m or N.
        jacobian: [D, F] derivatives of the coefficients with respect to ``unit``.
        residuals: of each recording [T, C], simulated minus recorded, m or N.
        cost: deviance of the coefficients plus the squared distance of the genes from their prior.
        motion_genes: [F] genes whose periodic motion is the initial motion of simulations near this fit.
        damping: factor of the last step that lowered the cost, with which the next step begins.
        jacobian_measured: whether all columns were measured at this fit.
        converged: whether the fit ended because no step gained enough.
    """

    problem: Problem
    unit: Float[Array, " F"]
    coefficients: Float[Array, " D"]
    jacobian: Float[Array, "D F"]
    residuals: tuple[Array, ...]
    cost: float
    motion_genes: Float[Array, " F"]
    damping: float = FIRST_DAMPING
    jacobian_measured: bool = False
    converged: bool = False

    @property
    def individual(self) -> Float[Array, "1 F"]:
        """Values [1, F] of the free genes, a batch of one individual."""
        return values_at(free_genes(self.problem), self.unit[None])

    @property
    def values(self) -> dict[str, float]:
        """Values of the free genes by name."""
        return dict(zip(self.problem.free, self.individual[0].tolist(), strict=True))

    @property
    def genome(self) -> Float[Array, " G"]:
        """Values [G] of all genes of the model."""
        return np.asarray(self.problem.genomes(self.individual)[0])


def broyden_fit(
    context: FitContext,
    problem: Problem,
    start: Float[Array, " F"],
    jacobian: Float[Array, "D F"] | None = None,
    *,
    known: Bool[Mask, " F"] | None = None,
    steps: int = 8,
) -> Fit:
    """Fit the free genes from ``start`` [F] with Broyden updates; InitialSimulationError where it cannot be simulated.

    ``jacobian`` [D, F] is used in the columns ``known`` [F]; the other columns are measured first, and again where a
    step gains much less than predicted. If that does not help, all columns are measured, once. At most ``steps`` steps.
    """
    simulator = _Simulator(context, problem)
    first = _initial_fit(simulator, start)
    columns = np.zeros(len(start), bool) if known is None or jacobian is None else known
    own = np.zeros((len(first.coefficients), len(start))) if jacobian is None else jacobian
    now = _measure_columns(simulator, replace(first, jacobian=own), ~columns)
    now = replace(now, jacobian_measured=not columns.any())
    pending = [np.ones(len(start), bool)]
    if columns.any() and not columns.all():
        pending.append(~columns)
    for _ in range(steps):
        better, gain = _step(simulator, now)
        if better is None:
            if now.jacobian_measured or not pending:
                return replace(now, converged=now.jacobian_measured)
            now = _measure_columns(simulator, now, pending.pop())
            continue
        ends, now = _converges(context.data, now, better, gain), better
        if ends:
            return replace(now, converged=True)
        if gain < GOOD_STEP_RATIO and pending:
            now = _measure_columns(simulator, now, pending.pop())
    return now


def gauss_newton_fit(context: FitContext, problem: Problem, start: Float[Array, " F"], steps: int) -> Iterator[Fit]:
    """Fit from ``start`` [F], with the Jacobian measured at every step and at the end; yields each step.

    At most ``steps`` steps. Differences are one-sided until steps gain little. Then they are central, and steps include
    geodesic acceleration (Transtrum and Sethna 2012, Sec. 3), which follows a curved valley of the cost.
    """
    simulator, every, accelerated = _Simulator(context, problem), np.ones(len(start), bool), False
    now = _measure_columns(simulator, _initial_fit(simulator, start), every, 1)
    for _ in range(steps):
        yield now
        better, gain = _step(simulator, now, accelerated=accelerated)
        ends = better is None or _converges(context.data, now, better, 1.0 if accelerated else gain)
        if ends and accelerated:
            yield replace(_measure_columns(simulator, better, every) if better else now, converged=True)
            return
        accelerated = accelerated or better is None or small_gain(context.data, now, better, SLOW_FACTOR)
        now = _measure_columns(simulator, better or now, every, 2 if accelerated else 1)
    yield now if accelerated else _measure_columns(simulator, now, every)


def with_measured_jacobian(context: FitContext, fit: Fit) -> Fit:
    """Return ``fit`` with all columns of its Jacobian measured.

    Broyden-updated columns are good enough for stepping, but not for confidence intervals.
    """
    if fit.jacobian_measured:
        return fit
    return _measure_columns(_Simulator(context, fit.problem), fit, np.ones(len(fit.unit), bool))


def _converges(data: WhitenedData, before: Fit, after: Fit, gain: float) -> bool:
    """Return whether to stop: a step gained little, though not much less than predicted (``gain``: their ratio)."""
    return small_gain(data, before, after) and gain > GOOD_STEP_RATIO / 2


def small_gain(data: WhitenedData, before: Fit, after: Fit, times: float = 1.0) -> bool:
    """Return whether a step decreased the cost by at most ``times`` the least decrease that is worth another step."""
    whole = data.likelihood_weight(before.coefficients) * data.chi_squared(before.coefficients)
    return before.cost - after.cost <= times * max(COST_TOLERANCE, RELATIVE_TOLERANCE * whole)


def _cost(data: WhitenedData, coefficients: Array, unit: Array) -> Array:
    return np.asarray(data.deviance(coefficients) + ((unit - 0.5) ** 2).sum(axis=-1) / PRIOR_SD**2)


@dataclass(frozen=True)
class _Simulator:
    """Simulates individuals of ``problem``, given by genes scaled so that their bounds are 0 and 1."""

    context: FitContext
    problem: Problem

    def at(self, units: Array, motion_genes: Array) -> tuple[Array, tuple[str | None, ...], list[Array]]:
        """Simulate ``units`` [B, F], starting from the motion of ``motion_genes`` [F]; as WhitenedData.evaluate."""
        problem, genes = self.problem, free_genes(self.problem)
        genome = problem.genomes(values_at(genes, motion_genes[None]))[0]
        model = self.context.subject.with_initial_motion(problem.model, genome)
        return self.context.evaluate(replace(problem, model=model), values_at(genes, units))

    def outputs(self, motion_genes: Array, units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        """Return coefficients as the only output, and why individuals failed, as :func:`differences` requires."""
        found, reasons, _ = self.at(units, motion_genes)
        return [found], reasons

    def tangent(self, motion_genes: Array) -> Simulate | None:
        """Return a function that simulates the first of a batch, and its neighbours to first order.

        It starts from the motion of ``motion_genes`` [F]; None if the model is not differentiable.
        """
        genes = free_genes(self.problem)
        tangent = tangent_problem(self.problem, values_at(genes, motion_genes[None])[0])
        if tangent is None:
            return None

        def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
            found, reasons, _ = self.context.evaluate(tangent, values_at(genes, units))
            return [found], reasons

        return simulate


def _initial_fit(simulator: _Simulator, unit: Array) -> Fit:
    found, reasons, residuals = simulator.at(unit[None], unit)
    if reasons[0] is not None:
        values = zip(free_genes(simulator.problem), unit, strict=True)
        values_text = ", ".join(f"{gene.name} = {float(gene.from_unit(one)):.4g}" for gene, one in values)
        raise InitialSimulationError(
            f"the model cannot be simulated at the start of the fit ({values_text}): {reasons[0]}; "
            "start from other genes, or check the rig's estimates"
        )
    cost = float(_cost(simulator.context.data, found[0], unit))
    none = np.zeros((found.shape[1], len(unit)))
    return Fit(simulator.problem, unit, found[0], none, tuple(r[0] for r in residuals), cost, unit)


def _measure_columns(simulator: _Simulator, fit: Fit, which: Mask, sides: int = 2) -> Fit:
    """Return ``fit`` with columns ``which`` [F] of its Jacobian measured.

    Where the model is not differentiable, they are differences to one or two ``sides``.
    """
    (columns,) = np.nonzero(which)
    if not len(columns):
        return fit
    simulate = partial(simulator.outputs, fit.motion_genes)
    tangent = simulator.tangent(fit.motion_genes)
    found = derivatives(simulate, tangent, fit.unit, columns, at=[fit.coefficients], sides=sides)
    jacobian = fit.jacobian.copy()
    jacobian[:, columns] = found.slopes[0]
    return replace(fit, jacobian=jacobian, jacobian_measured=bool(which.all()))


def _step(simulator: _Simulator, fit: Fit, *, accelerated: bool = False) -> tuple[Fit | None, float]:
    """Try several damped steps; return the best, its Jacobian updated, and its actual / predicted decrease of the cost.

    ``accelerated``: try steps with geodesic acceleration as well. (None, 0) where no step decreases the cost.
    """
    data = simulator.context.data
    damped = _DampedSteps(data, fit)
    moves = np.array([damped.move(d) for d in damped.dampings])
    accelerations = np.zeros((len(moves), len(fit.coefficients)))
    if accelerated:
        added = _second_order(simulator, fit, moves[::2])
        moves = np.concatenate([moves, [damped.move(*pair) for pair in zip(damped.dampings[::2], added, strict=True)]])
        accelerations = np.concatenate([accelerations, added])
    units = np.clip(fit.unit + moves, 0.0, 1.0)
    predicted = fit.cost - _cost(data, fit.coefficients + moves @ fit.jacobian.T + accelerations, units)
    if predicted.max() <= 1e-9 * fit.cost:
        return None, 0.0
    found, reasons, residuals = simulator.at(units, fit.motion_genes)
    bad = np.array([reason is not None for reason in reasons])
    after = _cost(data, np.where(bad[:, None], FAILED_COEFFICIENT, found), units)
    trials = Trials.of(units, predicted, fit.cost, after, reasons)
    k = trials.best()
    if k is None:
        return None, 0.0
    jacobian = fit.jacobian
    for j in np.argsort(trials.decrease):  # the best last, so that the Jacobian reproduces it exactly
        if not bad[j]:
            jacobian = _broyden(jacobian, units[j] - fit.unit, found[j] - fit.coefficients)
    better = Fit(
        fit.problem,
        units[k],
        found[k],
        jacobian,
        tuple(r[k] for r in residuals),
        float(fit.cost - trials.decrease[k]),
        initial_motion(fit.motion_genes, units[k]),
        float(damped.own[k]) if k < len(damped.own) else fit.damping,
    )
    return better, trials.gain(k)


class _DampedSteps:
    """Gauss-Newton steps from a fit with S choices of what is added to the F curvatures, ``dampings`` [S, F].

    ``own``: factors of the first choices, proportional to each gene's curvature; the others are equal for all genes.
    """

    def __init__(self, data: WhitenedData, fit: Fit) -> None:
        white, self.slopes = data.whiten(fit.coefficients), data.whitened_slopes(fit.jacobian)
        self.weight, self.unit, self.data = data.likelihood_weight(fit.coefficients), fit.unit, data
        curvature = self.weight * self.slopes.T @ self.slopes + np.eye(len(fit.unit)) / PRIOR_SD**2
        self.quadratic = Quadratic(curvature, self.weight * self.slopes.T @ white + (fit.unit - 0.5) / PRIOR_SD**2)
        self.own = np.clip(fit.damping * DAMPING_FACTORS[0], LEAST_DAMPING, LARGEST_DAMPING)
        by_box = np.outer(DAMPING_FACTORS[1] / PRIOR_SD**2, np.ones(len(fit.unit)))
        self.dampings = np.concatenate([np.outer(self.own, np.diag(curvature)), by_box]) + SINGULAR * curvature.max()

    def move(self, damping: Array, acceleration: Array | None = None) -> Array:
        """Return the step [F] with ``damping`` [F]; ``acceleration`` [D]: second-order change of the coefficients."""
        accelerated = 0.0 if acceleration is None else self.weight * self.slopes.T @ self.data.whiten(acceleration)
        return self.quadratic.step(self.unit, damping, self.quadratic.slope + accelerated)


def _second_order(simulator: _Simulator, fit: Fit, moves: Array) -> Array:
    """Return the second-order changes [S, D] of the coefficients along ``moves`` [S, F]; zero where that fails."""
    part = np.minimum(1.0, ACCELERATION_STEP / np.maximum(np.abs(moves).max(axis=1, keepdims=True), 1e-12))
    found, reasons, _ = simulator.at(np.clip(fit.unit + part * moves, 0.0, 1.0), fit.motion_genes)
    accelerations = (found - fit.coefficients - part * moves @ fit.jacobian.T) / part**2
    accelerations[[reason is not None for reason in reasons]] = 0.0
    return np.asarray(accelerations)


def _broyden(jacobian: Array, move: Array, change: Array) -> Array:
    length = float(move @ move)
    if length < 1e-12:
        return jacobian
    return jacobian + np.outer(change - jacobian @ move, move) / length
