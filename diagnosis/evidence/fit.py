"""Fits in coefficients of the beat: Gauss-Newton in the box of the genes, with a Jacobian that learns on its way.

A diagnosis refits a dozen extended models that differ little from the nominal one. Their Jacobian is taken over from
it; only the columns of what was added are measured. Every step then improves it by what the step has shown (Broyden
1965), and it is measured anew where it no longer foretells what a step does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wingfit.calibration.estimates.linearised import free_genes, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.subject import Subject
from wingfit.inference.differences import Outputs, differences
from wingfit.inference.gauss_newton import Quadratic, Trials

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

PRIOR = 0.5  # standard deviation of a gene in parts of its box
# Steps tried at once: a group of lanes. Damping by parts of each gene's own curvature (Marquardt 1963), about
# the last good part, suits genes that are told one by one; damping by parts of the box (Levenberg 1944) leads along
# the bent valleys of stiffnesses that make up for each other.
TRIED = (10.0 ** np.array([-4.0, -1.0, 0.0, 1.0]), 10.0 ** np.array([0.5, 2.0, 3.5, 5.0]))
FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-6, 1e4  # of each gene's curvature
SINGULAR = 1e-12  # of the largest curvature, added to every damping so that no curvature is singular
GOOD = 0.6  # of the decrease that was promised: the Jacobian need not be measured anew
SETTLED = 2e-3  # of chi-squared, as far as it counts: a fit ends where a step takes less
SMALLEST = 0.3  # decrease of the cost that is worth another step
CRAWLING = 5.0  # times that, below which a step is a small one: the valley is bent, or its slopes are not known well
PROBE = 0.02  # of the box: how far along a step its bend is measured
BESIDE = 0.05  # of a box: a motion as near as this is near enough to begin beside
FAILED = 1e12  # coefficients of an individual that cannot be simulated count as this


class CannotBeginError(ValueError):
    """The model cannot be simulated where a fit begins."""


UNFIT = (CannotBeginError, np.linalg.LinAlgError)  # ends one fit, and not a diagnosis


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        problem: the model with its free genes.
        unit: [F] in parts of the boxes.
        coefficients: [D] of the residuals there.
        jacobian: [D, F] of the coefficients, per part of the box.
        residuals: per recording [T, C].
        cost: surprise at what is left (`Stack.surprise` in `whitened_recordings.py`), and at the genes by their prior.
        near: [F] whose motion individuals about this fit begin beside: its own, or that of one shortly before.
        damping: last good one.
        fresh: whether the Jacobian was measured there.
        converged: whether it ended because nothing was to be gained.
    """

    problem: Problem
    unit: Array
    coefficients: Array
    jacobian: Array
    residuals: tuple[Array, ...]
    cost: float
    near: Array
    damping: float = FIRST_DAMPING
    fresh: bool = False
    converged: bool = False

    @property
    def values(self) -> dict[str, float]:
        """Of the free genes."""
        found = values_at(free_genes(self.problem), self.unit[None])[0]
        return dict(zip(self.problem.free, found.tolist(), strict=True))


def fitted(
    subject: Subject,
    stack: Stack,
    problem: Problem,
    evaluator: Evaluator,
    start: Array,
    jacobian: Array | None = None,
    *,
    known: Flags | None = None,
    steps: int = 8,
) -> Fit:
    """Fit the free genes from ``start`` [F]; CannotBeginError where that cannot be simulated.

    ``jacobian`` [D, F] may be given where ``known`` [F]; the other columns are measured first, and again where a step
    does not keep its promise; if that does not help, all are, once.
    """
    look = _Look(subject, stack, problem, evaluator)
    first = _at(look, start)
    columns = np.zeros(len(start), bool) if known is None or jacobian is None else known
    own = np.zeros((len(first.coefficients), len(start))) if jacobian is None else jacobian
    now = replace(_measured(look, replace(first, jacobian=own), ~columns), fresh=not columns.any())
    again = [np.ones(len(start), bool)]
    if columns.any() and not columns.all():
        again.append(~columns)
    for _ in range(steps):
        better, gain = _step(look, now)
        if better is None:
            if now.fresh or not again:
                return replace(now, converged=now.fresh)
            now = _measured(look, now, again.pop())
            continue
        ends, now = _settles(stack, now, better, gain), better
        if ends:
            return replace(now, converged=True)
        if gain < GOOD and again:
            now = _measured(look, now, again.pop())
    return now


def thoroughly(
    subject: Subject, stack: Stack, problem: Problem, evaluator: Evaluator, start: Array, steps: int
) -> Iterator[Fit]:
    """The same with the Jacobian measured anew at every step, and where it ends; yields every step, the fit last.

    One-sided differences point the way until they lead no further, or hardly. Then they are central, and steps follow
    the bend of the valley as well (geodesic acceleration: Transtrum and Sethna 2012, Sec. 3).
    """
    look, every, bent = _Look(subject, stack, problem, evaluator), np.ones(len(start), bool), False
    now = _measured(look, _at(look, start), every, 1)
    for _ in range(steps):
        yield now
        better, gain = _step(look, now, bent=bent)
        ends = better is None or _settles(stack, now, better, 1.0 if bent else gain)
        if ends and bent:
            yield replace(_measured(look, better, every), converged=True) if better else replace(now, converged=True)
            return
        bent = bent or better is None or gained_little(stack, now, better, CRAWLING)
        now = _measured(look, better or now, every, 2 if bent else 1)
    yield now if bent else _measured(look, now, every)


def measured(subject: Subject, stack: Stack, evaluator: Evaluator, fit: Fit) -> Fit:
    """``fit`` with all slopes measured where it ended: those that steps have learnt lead on, and make no intervals."""
    if fit.fresh:
        return fit
    return _measured(_Look(subject, stack, fit.problem, evaluator), fit, np.ones(len(fit.unit), bool))


def _settles(stack: Stack, before: Fit, after: Fit, gain: float) -> bool:
    """Whether a step gained so little, though it kept its promise, that no other is worth its cost."""
    return gained_little(stack, before, after) and gain > GOOD / 2


def gained_little(stack: Stack, before: Fit, after: Fit, times: float = 1.0) -> bool:
    """Whether the step gained no more than some ``times`` what makes one worth its cost."""
    whole = stack.trust(before.coefficients) * stack.chi_squared(before.coefficients)
    return before.cost - after.cost <= times * max(SMALLEST, SETTLED * whole)


def _cost(stack: Stack, coefficients: Array, unit: Array) -> Array:
    return np.asarray(stack.surprise(coefficients) + ((unit - 0.5) ** 2).sum(axis=-1) / PRIOR**2)


@dataclass(frozen=True)
class _Look:
    """How a fit sees its problem."""

    subject: Subject
    stack: Stack
    problem: Problem
    evaluator: Evaluator

    def at(self, units: Array, near: Array) -> tuple[Array, tuple[str | None, ...], list[Array]]:
        """As :meth:`diagnosis.evidence.whitened_recordings.Stack.evaluate`, for individuals [B, F] near another [F]."""
        problem, genes = self.problem, free_genes(self.problem)
        genome = problem.genomes(values_at(genes, near[None]))[0]
        model = self.subject.beside(problem.model, genome)
        here = Problem(model, problem.recordings, problem.free, problem.base, problem.axes)
        return self.stack.evaluate(here, self.evaluator, values_at(genes, units))


def _at(look: _Look, unit: Array) -> Fit:
    found, reasons, residuals = look.at(unit[None], unit)
    if reasons[0] is not None:
        values = values_at(free_genes(look.problem), unit[None])[0]
        told = ", ".join(f"{name} = {value:.4g}" for name, value in zip(look.problem.free, values, strict=True))
        raise CannotBeginError(
            f"the model cannot be simulated where the fit begins ({told}): {reasons[0]}; start from other genes, or "
            "check the rig's estimates"
        )
    cost = float(_cost(look.stack, found[0], unit))
    none = np.zeros((found.shape[1], len(unit)))
    return Fit(look.problem, unit, found[0], none, tuple(r[0] for r in residuals), cost, unit)


def _measured(look: _Look, fit: Fit, which: Flags, sides: int = 2) -> Fit:
    """``fit`` with the columns ``which`` of its Jacobian measured by differences to one or two sides in the box."""
    (columns,) = np.nonzero(which)
    if not len(columns):
        return fit

    def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        found, reasons, _ = look.at(units, fit.near)
        return [found], reasons

    found = differences(simulate, fit.unit, columns, at=[fit.coefficients], sides=sides)
    jacobian = fit.jacobian.copy()
    jacobian[:, columns] = found.slopes[0]
    return replace(fit, jacobian=jacobian, fresh=bool(which.all()))


def _step(look: _Look, fit: Fit, *, bent: bool = False) -> tuple[Fit | None, float]:
    """The best of several damped steps, its Jacobian improved by what they show, and gain over promise.

    ``bent`` asks for steps along the bend of the valley as well.
    """
    damped = _Damped(look.stack, fit)
    moves = np.array([damped.move(d) for d in damped.dampings])
    bends = np.zeros((len(moves), len(fit.coefficients)))
    if bent:
        every, bends = _bends(look, fit, moves[::2]), np.concatenate([bends, bends[::2]])
        moves = np.concatenate([moves, [damped.move(*pair) for pair in zip(damped.dampings[::2], every, strict=True)]])
        bends[-len(every) :] = every
    units = np.clip(fit.unit + moves, 0.0, 1.0)
    promised = fit.cost - _cost(look.stack, fit.coefficients + moves @ fit.jacobian.T + bends, units)
    if promised.max() <= 1e-9 * fit.cost:
        return None, 0.0
    found, reasons, residuals = look.at(units, fit.near)
    bad = np.array([reason is not None for reason in reasons])
    after = _cost(look.stack, np.where(bad[:, None], FAILED, found), units)
    trials = Trials.of(units, promised, fit.cost, after, reasons)
    k = trials.best()
    if k is None:
        return None, 0.0
    jacobian = fit.jacobian
    for j in np.argsort(trials.decrease):  # the best last: what it shows holds exactly
        if not bad[j]:
            jacobian = _broyden(jacobian, units[j] - fit.unit, found[j] - fit.coefficients)
    better = Fit(
        fit.problem,
        units[k],
        found[k],
        jacobian,
        tuple(r[k] for r in residuals),
        float(fit.cost - trials.decrease[k]),
        fit.near if np.abs(units[k] - fit.near).max() <= BESIDE else units[k],
        float(damped.own[k]) if k < len(damped.own) else fit.damping,
    )
    return better, trials.gain(k)


class _Damped:
    """Steps from a fit with several dampings: [S, F] of all, ``own`` by parts of each gene's own curvature."""

    def __init__(self, stack: Stack, fit: Fit) -> None:
        white, self.slopes = fit.coefficients / stack.scale, fit.jacobian / stack.scale[:, None]
        self.trust, self.unit, self.scale = stack.trust(fit.coefficients), fit.unit, stack.scale
        curvature = self.trust * self.slopes.T @ self.slopes + np.eye(len(fit.unit)) / PRIOR**2
        self.quadratic = Quadratic(curvature, self.trust * self.slopes.T @ white + (fit.unit - 0.5) / PRIOR**2)
        self.own = np.clip(fit.damping * TRIED[0], LEAST_DAMPING, LARGEST_DAMPING)
        by_box = np.outer(TRIED[1] / PRIOR**2, np.ones(len(fit.unit)))
        self.dampings = np.concatenate([np.outer(self.own, np.diag(curvature)), by_box]) + SINGULAR * curvature.max()

    def move(self, damping: Array, bend: Array | float = 0.0) -> Array:
        """The step [F] with a ``damping`` [F], where coefficients change by ``bend`` [D] beside its slopes."""
        bent = self.trust * self.slopes.T @ np.broadcast_to(bend / self.scale, len(self.scale))
        return self.quadratic.step(self.unit, damping, self.quadratic.slope + bent)


def _bends(look: _Look, fit: Fit, moves: Array) -> Array:
    """[S, D] of ``moves`` [S, F]: what coefficients change along each beside its slopes, by their second derivative."""
    part = np.minimum(1.0, PROBE / np.maximum(np.abs(moves).max(axis=1, keepdims=True), 1e-12))
    found, reasons, _ = look.at(np.clip(fit.unit + part * moves, 0.0, 1.0), fit.near)
    bends = (found - fit.coefficients - part * moves @ fit.jacobian.T) / part**2
    bends[[reason is not None for reason in reasons]] = 0.0
    return np.asarray(bends)


def _broyden(jacobian: Array, move: Array, change: Array) -> Array:
    length = float(move @ move)
    if length < 1e-12:
        return jacobian
    return jacobian + np.outer(change - jacobian @ move, move) / length
