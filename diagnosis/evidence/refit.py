"""Fit the nominal model with one or several suspects added, and cross-validate the fits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, values_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import (
    COST_TOLERANCE,
    FIT_ERRORS,
    PRIOR_SD,
    Fit,
    broyden_fit,
    gauss_newton_fit,
    with_measured_jacobian,
)
from wingfit.diagnosis.evidence.screen import Nuisance, Trial, off_units, positions_of, size_columns, units_at_position
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.inference.gauss_newton import Quadratic
from wingfit.inference.score_test import explained
from wingfit.records.array_types import Array, Float, Mask
from wingfit.records.series import belongs_to

REFIT_STEPS = 6  # of a refit
CONTINUED_STEPS = 10  # of a refit that is continued
FINAL_STEPS = 20  # of the best hypothesis, until it converges
AT_BOUND = 1e-9  # from a bound, in genes scaled to 0..1: as far as rounding takes a gene that is at it
NEAR_POSITION, NEAR_ZERO = 0.25, 0.002  # relative distance from a position of a choice, and from zero
BESIDE_CHOSEN = 0.05  # the same, from zero, beside another choice of the same suspect that is at a position
MAX_HALVINGS = 3  # of the suspects' initial sizes if the start cannot be simulated


@dataclass(frozen=True)
class Refit:
    """The nominal model with suspects added, all genes fitted.

    Attributes:
        trials: the trial from which each suspect started; empty for the nominal model.
        fit: the fit.
        excess: mean square of the residual minus that of the noise, m^2 or N^2.
        predicted: the same cross-validated, recordings left out one at a time; None with a single recording.
    """

    trials: tuple[Trial, ...]
    fit: Fit
    excess: float
    predicted: float | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the suspects."""
        return tuple(trial.suspect.name for trial in self.trials)

    @property
    def freedom(self) -> int:
        """Number of genes that the suspects add."""
        return sum(trial.freedom for trial in self.trials)


def make_refit(data: WhitenedData, fit: Fit, trials: Sequence[Trial] = ()) -> Refit:
    """Return ``fit`` of a model with the suspects of ``trials``, with its excess, fitted and cross-validated."""
    return Refit(tuple(trials), fit, data.excess(fit.coefficients), cross_validated_excess(data, fit))


def is_in_position(refit: Refit) -> bool:
    """Return whether each size that is a choice (:attr:`Suspect.positions`) is zero or near one of its positions.

    A suspect all of whose sizes are choices must have one that is not zero.
    """
    for suspect in (trial.suspect for trial in refit.trials):
        sizes = [(refit.fit.values[name], positions) for name, positions in suspect.positions.items()]
        others = [
            abs(value) / min(map(abs, positions))
            for value, positions in sizes
            if not any(abs(value - one) <= NEAR_POSITION * abs(one) for one in positions)
        ]
        chosen = len(others) < len(sizes)
        if max(others, default=0.0) > (BESIDE_CHOSEN if chosen else NEAR_ZERO):
            return False
        if sizes and not chosen and len(sizes) == len(suspect.size_genes):
            return False
    return True


def cross_validated_excess(data: WhitenedData, fit: Fit) -> float | None:
    """Return the mean square beyond the noise (m^2 or N^2) of experiments that are each predicted from the others.

    Each prediction is that of the linearised model, fitted to the recordings of other experiments within the bounds. A
    prior limits how far genes move, so that a gene that only one recording identifies does not count against the
    hypothesis; nor does the move that noise in the other recordings makes. Genes that belong to the recording alone (an
    initial state) are fitted to it again. None for a single experiment.
    """
    if len(data.experiments) < 2:
        return None
    white, slopes = data.whiten(fit.coefficients), data.whitened_slopes(fit.jacobian)
    grams = [slopes[part].T @ slopes[part] for part in data.recording_slices]
    scores = [slopes[part].T @ white[part] for part in data.recording_slices]
    likelihood_weight, prior = data.likelihood_weight(fit.coefficients), (fit.unit - 0.5) / PRIOR_SD**2
    gram = likelihood_weight * sum(grams) + np.eye(len(fit.unit)) * (data.policy.gene_freedom**-2 + PRIOR_SD**-2)
    score = likelihood_weight * sum(scores) + prior
    total = 0.0
    for experiment in data.experiments:
        left_gram, left_score = sum(grams[r] for r in experiment), sum(scores[r] for r in experiment)
        others, curvature = sum(grams) - left_gram, gram - likelihood_weight * left_gram
        move = Quadratic(curvature, score - likelihood_weight * left_score).step(fit.unit, np.zeros(len(fit.unit)))
        free = np.abs(fit.unit + move - 0.5) < 0.5 - AT_BOUND
        spread = np.zeros_like(curvature)
        spread[np.ix_(free, free)] = np.linalg.inv(curvature[np.ix_(free, free)])
        noisy = likelihood_weight**2 * spread @ others @ spread
        for r in experiment:
            part = data.recording_slices[r]
            here, slope, weight = fit.coefficients[part], fit.jacobian[part], data.weight[part]
            there = _refitted_alone(data, fit, r, here + slope @ move)
            worse = float(weight @ (there**2 - here**2))
            own = _refitted_alone(data, fit, r, slope)
            by_noise = float(weight @ np.einsum("df,fg,dg->d", own, noisy, own, optimize=True))
            total += float(weight @ (here**2 - data.variance[part])) + max(
                worse - data.policy.prediction_noise * by_noise, 0.0
            )
    return total


def _refitted_alone(data: WhitenedData, fit: Fit, r: int, coefficients: Array) -> Array:
    """Return ``coefficients`` [D, ...] of recording ``r`` after the genes of it alone are fitted to them."""
    recording, part = data.recordings[r], data.recording_slices[r]
    own = [k for k, name in enumerate(fit.problem.free) if belongs_to(name, recording.name)]
    if not own:
        return coefficients
    slopes, whitening = fit.jacobian[part][:, own], data.whitening.of_part(part)
    white = whitening.whiten(coefficients.T).T
    move, *_ = np.linalg.lstsq(whitening.whiten(slopes.T).T, white, rcond=None)
    return np.asarray(coefficients - slopes @ move)


def refit_with(context: FitContext, nominal: Fit, trials: Sequence[Trial], base: Fit | None = None) -> Refit | None:
    """Fit the nominal model with the suspects of ``trials``, each from its trial's location and size.

    ``nominal``: fit of the nominal model; ``base``: a fit that already contains all suspects but the last, if there is
    one. None where no start can be simulated, even with smaller sizes.
    """
    before, data = base or nominal, context.data
    model = context.subject.extended([trial.suspect.name for trial in trials])
    added = [trials[-1]] if base else list(trials)
    genes = [(gene.name, trial) for trial in added for gene in trial.suspect.genes]
    values = nominal.problem.base.replace(nominal.values).as_dict() | before.values
    free = (*before.problem.free, *(name for name, _ in genes))
    problem = context.problem(model, free, base_genome(model, values))
    for part in 0.5 ** np.arange(MAX_HALVINGS):
        start = np.concatenate([before.unit, *(_scaled_start(trial, part) for trial in added)])
        try:
            fit = _fit_added_genes(context, problem, start, before.jacobian)
        except FIT_ERRORS:
            continue
        sizes = np.array([True] * len(before.unit) + [gene in trial.suspect.size_genes for gene, trial in genes])
        diverged = data.chi_squared(fit.coefficients) > data.policy.diverged * trials[0].remaining_chi_squared
        if len(trials) == 1 and diverged and not sizes.all():
            with suppress(*FIT_ERRORS):
                first = _fit_added_genes(context, problem, *_fit_subset(context, problem, start, before, sizes))
                fit = min((fit, first), key=lambda one: one.cost)
        fit = _no_worse(context, problem, before, added, fit)
        if len(trials) == 1 and trials[0].suspect.positions:
            every = [
                make_refit(data, one, trials) for one in (fit, *_at_positions(context, problem, before, trials[0]))
            ]
            return min(every, key=lambda one: (not is_in_position(one), one.fit.cost))
        return make_refit(data, fit, trials)
    return None


def _at_positions(context: FitContext, problem: Problem, before: Fit, trial: Trial) -> Iterator[Fit]:
    """Yield fits that begin at each position of a choice of ``trial``, to which the nominal genes are fitted first.

    A choice changes much at once, and from the genes of the fit ``before`` a fit may end between two positions.
    """
    genes = list(trial.suspect.genes)
    for one in positions_of(trial.suspect):
        chosen = units_at_position(trial, *one)
        values = values_at(genes, chosen[None])[0].tolist()
        base = problem.base.replace(dict(zip((gene.name for gene in genes), values, strict=True)))
        with suppress(*FIT_ERRORS):
            *_, others = gauss_newton_fit(
                context, replace(problem, free=before.problem.free, base=base), before.unit, REFIT_STEPS
            )
            yield broyden_fit(context, problem, np.concatenate([others.unit, chosen]), steps=REFIT_STEPS)


def _no_worse(context: FitContext, problem: Problem, before: Fit, added: Sequence[Trial], fit: Fit) -> Fit:
    """Return ``fit``, or a better fit from ``before`` with the suspects of ``added`` off if it is worse than that.

    A model that includes another cannot fit worse: where it does, its fit has ended in a local minimum.
    """
    off = np.concatenate([_scaled_start(trial, 0.0) for trial in added])
    if fit.cost <= before.cost + float(np.sum((off - 0.5) ** 2)) / PRIOR_SD**2 + COST_TOLERANCE:
        return fit
    with suppress(*FIT_ERRORS):
        again = _fit_added_genes(context, problem, np.concatenate([before.unit, off]), before.jacobian)
        return min((fit, again), key=lambda one: one.cost)
    return fit


def _fit_added_genes(context: FitContext, problem: Problem, start: Array, first_columns: Array) -> Fit:
    """Fit all genes of ``problem`` from ``start`` [F]; ``first_columns`` [D, K] of the Jacobian are known."""
    known = np.arange(len(start)) < first_columns.shape[1]
    jacobian = np.zeros((len(first_columns), len(start)))
    jacobian[:, known] = first_columns[:, : known.sum()]
    return broyden_fit(context, problem, start, jacobian, known=known, steps=REFIT_STEPS)


def _fit_subset(context: FitContext, problem: Problem, start: Array, before: Fit, which: Mask) -> tuple[Array, Array]:
    """Fit the genes ``which`` [F] of ``problem`` only, because shape genes that move before the size may diverge.

    Returns all genes [F], with those not fitted as in ``start`` [F], and the Jacobian's columns [D, K] of the K genes
    that the fit ``before`` has.
    """
    genes = free_genes(problem)
    base = problem.base.replace(dict(zip(problem.free, values_at(genes, start[None])[0].tolist(), strict=True)))
    free = tuple(name for name, one in zip(problem.free, which, strict=True) if one)
    found = _fit_added_genes(context, replace(problem, free=free, base=base), start[which], before.jacobian)
    unit, jacobian = start.copy(), np.zeros((len(found.coefficients), len(start)))
    unit[which], jacobian[:, which] = found.unit, found.jacobian
    return unit, jacobian[:, : len(before.unit)]


def refit_without(context: FitContext, refit: Refit, left_out: Trial) -> Refit | None:
    """Fit ``refit`` without the suspect of the trial ``left_out``, from its present genes; None if that fails."""
    trials, fit = [trial for trial in refit.trials if trial is not left_out], refit.fit
    names = {gene.name for gene in left_out.suspect.genes}
    kept = np.array([name not in names for name in fit.problem.free])
    model = context.subject.extended([trial.suspect.name for trial in trials])
    known = fit.problem.base.replace(fit.values).as_dict()
    values = {name: value for name, value in known.items() if name not in names}
    free = tuple(name for name in fit.problem.free if name not in names)
    try:
        problem = context.problem(model, free, base_genome(model, values))
        found = _fit_added_genes(context, problem, fit.unit[kept], fit.jacobian[:, kept])
    except FIT_ERRORS:
        return None
    return make_refit(context.data, found, trials)


def refit_at(context: FitContext, refit: Refit, start: Float[Array, " F"] | None = None) -> Refit | None:
    """Fit ``refit`` again with the model of ``context``, from its present genes or from ``start`` [F].

    None where that cannot be simulated.
    """
    before, problem = refit.fit, replace(refit.fit.problem, model=context.subject.extended(refit.names))
    genes, known_columns = (before.unit, before.jacobian) if start is None else (start, before.jacobian[:, :0])
    try:
        fit = _fit_added_genes(context, problem, genes, known_columns)
    except FIT_ERRORS:
        return None
    return make_refit(context.data, fit, refit.trials)


def continue_fit(context: FitContext, refit: Refit, steps: int = CONTINUED_STEPS) -> Refit:
    """Continue ``refit`` for up to ``steps`` steps, the Jacobian being measured at every step.

    Returns it unchanged where that cannot be simulated: an individual whose simulation started from the motion of
    similar genes may flutter when it starts from rest.
    """
    fit = refit.fit
    try:
        for better in gauss_newton_fit(context, fit.problem, fit.unit, steps):
            fit = better
    except FIT_ERRORS:
        return refit
    return make_refit(context.data, fit, refit.trials)


def fit_to_convergence(context: FitContext, refit: Refit) -> Refit:
    """Continue ``refit`` unless it has converged, and measure its Jacobian: score tests require both."""
    if not refit.fit.converged:
        refit = continue_fit(context, refit)
    return make_refit(context.data, with_measured_jacobian(context, refit.fit), refit.trials)


def strongest_trials(data: WhitenedData, found: Sequence[list[Trial]], limit: int) -> list[Trial]:
    """Return up to ``limit`` trials, strongest first: the best of each suspect worth a refit (`Policy.worth_refit`)."""
    policy = data.policy
    best = sorted((trials[0] for trials in found if trials), key=lambda trial: -trial.gain)
    return [trial for trial in best[:limit] if trial.gain >= policy.worth_refit * best[0].gain and trial.gain > 0.0]


def partner_trials(data: WhitenedData, base: Refit, found: Sequence[list[Trial]]) -> list[Trial]:
    """Return the trials in ``found`` of second effects that would explain most of the residual of ``base``."""
    nuisance = Nuisance(data, base.fit)
    residual = nuisance.residual
    least_gain = data.policy.partner_gain * (float(residual @ residual) - len(residual))
    return [trial for gain, trial in _by_explained(nuisance, residual, found, base.names) if gain > least_gain]


def contribution(context: FitContext, refit: Refit, trials: Sequence[Trial] = ()) -> Float[Array, " D"] | None:
    """Return how the coefficients [D] change when the suspects of ``trials`` (all by default) are switched off.

    All other genes stay the same. None where that cannot be simulated.
    """
    fit, off = refit.fit, dict(refit.fit.values)
    for trial in trials or refit.trials:
        off |= {gene.name: gene.nominal for gene in trial.suspect.genes if gene.name in trial.suspect.size_genes}
    found, reasons, _ = context.evaluate(fit.problem, np.array([list(off.values())]))
    return None if reasons[0] else np.asarray(found[0] - fit.coefficients)


def substitute_trials(
    context: FitContext, refit: Refit, trial: Trial, found: Sequence[list[Trial]], limit: int
) -> list[Trial]:
    """Return up to ``limit`` trials of other suspects that can reproduce most of what ``trial`` adds to ``refit``."""
    change = contribution(context, refit, [trial])
    if change is None:
        return []
    own = {gene.name for gene in trial.suspect.genes}
    kept = np.array([name not in own for name in refit.fit.problem.free])
    fit = refit.fit
    others = replace(fit, unit=fit.unit[kept], jacobian=fit.jacobian[:, kept], motion_genes=fit.motion_genes[kept])
    nuisance = Nuisance(context.data, others)
    done = nuisance.project_out(change)
    least_gain = context.data.policy.substitute * float(done @ done)
    return [one for gain, one in _by_explained(nuisance, done, found, refit.names)[:limit] if gain > least_gain]


def _by_explained(
    nuisance: Nuisance, misfit: Array, found: Sequence[list[Trial]], known: Sequence[str]
) -> list[tuple[float, Trial]]:
    """Return the trial of each suspect not ``known`` that explains most of ``misfit``, with the decrease; best first.

    ``misfit`` [N]: whitened, without what the nuisance genes explain; the decrease is that of its sum of squares.
    """
    best = []
    for trials in found:
        if trials and trials[0].suspect.name not in known:
            gains = [explained(nuisance.project_out(trial.changes), misfit) for trial in trials]
            k = int(np.argmax(gains))
            best.append((gains[k], trials[k]))
    return sorted(best, key=lambda pair: -pair[0])


def suspect_pairs(
    data: WhitenedData, nominal: Fit, found: Sequence[list[Trial]], beyond: float, limit: int
) -> Iterator[tuple[Trial, Trial]]:
    """Yield pairs of suspects that together are predicted to reach a chi-squared below ``beyond``, best first.

    ``found``: trials of each suspect at the fit ``nominal``; only the ``limit`` best pairs are considered.
    """
    nuisance = Nuisance(data, nominal)
    residual = nuisance.residual
    best = [trials[0] for trials in found if trials and trials[0].gain > 0.0]
    own = [nuisance.project_out(trial.changes) for trial in best]
    indices = [(i, j) for i in range(len(best)) for j in range(i)]
    scored = [(explained(np.vstack([own[i], own[j]]), residual), best[i], best[j]) for i, j in indices]
    scored.sort(key=lambda triple: -triple[0])
    for gain, one, other in scored[:limit]:
        if float(residual @ residual) - gain < beyond:
            yield (one, other) if one.gain >= other.gain else (other, one)


def _scaled_start(trial: Trial, part: float) -> Array:
    """Return the initial genes [E] of the suspect (bounds at 0 and 1) with its size multiplied by ``part``."""
    start, off, size = trial.start, off_units(trial.suspect), size_columns(trial.suspect)
    start[size] = off[size] + part * (start[size] - off[size])
    return start
