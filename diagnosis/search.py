"""Search for missing physics: fit the nominal model, score-test suspects, refit single effects, then several."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from wingfit.diagnosis.combinations import combined_refits, further_effects, singles_and_pairs, smaller_refits
from wingfit.diagnosis.evidence.competing_fits import (
    FIRST_STEPS,
    StartPoint,
    fit_from_estimates,
    large_start,
    start_points,
)
from wingfit.diagnosis.evidence.fit import FIT_ERRORS, Fit
from wingfit.diagnosis.evidence.nominal import Nominal, choose_discretisation, fit_nominal, improves
from wingfit.diagnosis.evidence.refit import (
    FINAL_STEPS,
    Refit,
    continue_fit,
    make_refit,
    refit_at,
    refit_with,
    strongest_trials,
)
from wingfit.diagnosis.evidence.screen import Trial, positions_of, score_tests, units_at_position
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.refinement import MAX_CONTINUED, refine_with_effects
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.subject import select_suspects
from wingfit.diagnosis.verdict.verdict import decide
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, nominal_suffices, tolerated_excess, weigh
from wingfit.rigs.suspect import Suspect

Steps = Iterator[tuple[float, str]]  # fraction of the work done, and the next stage

FAULTS = ("measurement", "input")  # families of suspects that do not act within the simulation
MAX_INNER = 12  # suspects that are fitted from a large size
MAX_RESTARTED = 3  # suspects that are also fitted from the estimates
MAX_BASES = 2  # single effects that are fitted with each other one where nothing explains forces
COMBINED = 12  # refits with several effects, as a rule
MAX_OVERTAKING = 3  # hypotheses that have not converged and are looked at


def run_search(state: SearchState, free: tuple[str, ...]) -> Steps:
    """Fill ``state``, fitting the nominal genes ``free``; yields the fraction of the work done and the next stage."""
    spec = state.spec
    yield 0.0, "fitting the nominal model"
    if spec.start:
        with suppress(*FIT_ERRORS):
            state.initial_fit = state.context, next(fit_nominal(state.context, free, spec.calibration.fixed))
    for k, fit in enumerate(fit_nominal(state.context, free, {**spec.start, **spec.calibration.fixed})):
        state.initial_fit = state.initial_fit or (state.context, fit)
        yield 0.25 * (1.0 - 0.85 ** (k + 1)), "fitting the nominal model"
    state.judge_noise(fit)
    if state.allow_for_position_errors(fit):
        yield 0.24, "fitting the nominal model, allowing for errors of positions"
        fit = state.fitted_again(fit)
    yield 0.25, "comparing with a finer discretisation"
    suspects = state.suspects
    tested, again = (0.55, 0.6) if spec.exhaustive or state.data.kind == "forces" else (0.85, 0.92)
    for fraction, stage in _search_coarse_first(state, fit, suspects):
        yield 0.3 + (tested - 0.3) * fraction, stage
    yield tested, "fitting the nominal model again"
    better = _nominal_from_best(state)
    if better is not None:
        state.restart_from(replace(state.fitted_nominal, refit=better))
        for fraction, stage in _try_suspects(state, suspects):
            yield tested + (again - tested) * fraction, stage
    yield again, "comparing with a finer discretisation"
    yield from _towards(_refine_and_extend(state), again, again + 0.01, 2 * len(suspects))
    yield from ((again + 0.01, stage) for stage in smaller_refits(state))
    if state.refits and (spec.exhaustive or (state.data.kind == "forces" and not state.one_effect_explains)):
        pairs = singles_and_pairs(state, None if spec.exhaustive else MAX_BASES)
        yield from ((again + 0.01 + (0.93 - again) * part, stage) for part, stage in pairs)
    yield 0.94, "continuing the best refits"
    if state.refits:
        _continue_best(state)
    nominal = state.fitted_nominal
    floor = state.floor(nominal.remaining_error if spec.refine else nominal.discretisation_error or 0.0)
    yield from _towards(_final_fits(state, floor, len(suspects)), 0.95, 1.0, FINAL_STEPS)


def _towards(stages: Iterator[str], start: float, end: float, expected: int) -> Steps:
    """Yield ``stages`` with fractions from ``start`` towards ``end``; the ``expected`` number goes two thirds of it."""
    for k, stage in enumerate(stages):
        yield start + (end - start) * (1.0 - float(np.exp(-(k + 1) / max(expected, 1)))), stage


def _suffices(state: SearchState, nominal: Nominal, suspects: int) -> bool:
    return nominal_suffices(state.data, nominal.refit, suspects, nominal.remaining_error)


def _search_coarse_first(state: SearchState, fit: Fit, suspects: Sequence[Suspect]) -> Steps:
    """Test suspects at the nominal ``fit``, or with a finer discretisation if that fits better than all suspects.

    The coarse one is first, since a finer one can absorb what a suspect does.
    """
    nominal = choose_discretisation(state.context, fit, refine=state.spec.refine)
    if nominal.subject is not state.subject and not _suffices(state, nominal, len(suspects)):
        state.restart_from(choose_discretisation(state.context, fit, refine=False))
        for fraction, stage in _try_suspects(state, suspects):
            yield 0.3 * fraction, stage
    if not any(improves(state.data, one, nominal.refit) for one in state.refits):
        state.restart_from(nominal)
        for fraction, stage in _try_suspects(state, suspects):
            yield 0.3 + 0.7 * fraction, stage


def _final_fits(state: SearchState, floor: float, suspects: int) -> Iterator[str]:
    """Fit the best hypothesis, and those that explain as much, until they converge; store the weights of all.

    ``floor`` (m or N): misfit of a right model beyond noise; ``suspects``: number of effects considered. Yields the
    name of each stage.
    """

    def weighed() -> HypothesisWeights:
        return weigh(state.data, state.fitted_nominal.refit, state.refits, floor, suspects)

    known = weighed()
    starts = _indistinguishable(known)
    if not starts or state.data.kind == "forces":  # a fit to tracks takes seconds
        starts += _look_alikes(state, decide(known).best)
    yield from _compete(state, starts)
    yield "fitting the best hypothesis until it converges"
    state.weights = weighed()
    for _ in range(MAX_CONTINUED):
        unconverged = _unconverged(state.weights)
        if unconverged is None:
            return
        state.add(continue_fit(state.context, unconverged, FINAL_STEPS))
        state.weights = weighed()


def _indistinguishable(weights: HypothesisWeights) -> list[StartPoint]:
    """Return start points of the single suspects with nearly the best evidence: a fit may be in a local minimum.

    Empty where there are fewer than two of them, or where a combination of effects is among them.
    """
    evidence = weights.evidence[1:]
    least = max(evidence.max(initial=0.0) - weights.policy.overtake, 0.0)
    close = [one for one, found in zip(weights.refits[1:], evidence, strict=True) if found > least]
    several = len(close) > 1 and all(len(one.trials) == 1 for one in close)
    return [entry for one in close for entry in start_points(one.trials[0])] if several else []


def _look_alikes(state: SearchState, best: Refit) -> list[StartPoint]:
    """Return start points in which one effect of the hypothesis ``best`` is replaced by one known to look similar.

    A score test does not see what the nominal genes, or a similar effect fitted first, have already absorbed. Choices,
    such as two signs, may explain the recordings equally, and exactly. Otherwise, where ``best`` leaves only noise, of
    forces in prediction too, an effect may be more probable only if it has fewer genes, such as a stall without a
    vortex, or, of forces, if the fit with it alone has not converged: the way to twice the forces is long.
    """
    forces = state.data.kind == "forces"
    unfinished = {one.names for one in state.refits if not one.fit.converged} if forces else set[tuple[str, ...]]()
    left = max(best.excess, best.predicted or 0.0) if forces else best.excess
    exact = left <= tolerated_excess(state.data, 0.0, 0.0)
    choice = any(part.suspect.positions for part in best.trials)
    found = {trials[0].suspect.name: trials[0] for trials in state.trials if trials}
    starts = []
    for part in best.trials:
        others = [trial for trial in best.trials if trial is not part]
        for name, trial in found.items():
            alike = name in part.suspect.confused_with or part.suspect.name in trial.suspect.confused_with
            smaller = len(trial.suspect.genes) < len(part.suspect.genes)
            if alike and name not in best.names and (choice or smaller or not exact or (name,) in unfinished):
                starts += start_points(trial, others, best)
    return starts


def _unconverged(weights: HypothesisWeights) -> Refit | None:
    """Return the best hypothesis if its fit has not converged, else such a rival that could overtake it, or None."""
    best = decide(weights).best
    if best.trials and not (best.fit.converged and best.fit.jacobian_measured):
        return best
    evidence = weights.evidence[1:]
    for k in np.argsort(-evidence, kind="stable")[: MAX_OVERTAKING if best.trials else 0]:
        rival: Refit = weights.refits[1:][k]
        if evidence[k] > evidence.max() - weights.policy.overtake and not rival.fit.converged:
            return rival
    return None


def _try_suspects(state: SearchState, suspects: Sequence[Suspect]) -> Steps:
    """Score-test ``suspects`` at the nominal fit, then refit the strongest; yields the fraction done and the stage."""
    tests = score_tests(state.context, state.fitted_nominal.refit.fit, suspects)
    for k, (suspect, trials) in enumerate(tests):
        state.trials.append(trials)
        yield 0.3 * (k + 1) / len(suspects), f"score test of {suspect.name}"
    if not _suffices(state, state.fitted_nominal, len(suspects)):
        yield from _refits(state)


def _nominal_from_best(state: SearchState) -> Refit | None:
    """Fit the nominal model from the genes of the best hypothesis; return the fit if clearly better, else None.

    If it is, the earlier nominal fit was in a local minimum, and the effects of that hypothesis are not the cause.
    """
    nominal = state.fitted_nominal.refit
    best = min(state.refits, key=lambda one: one.excess, default=nominal)
    if best is nominal or not improves(state.data, best, nominal):
        return None
    found = refit_at(state.context, nominal, best.fit.unit[: len(nominal.fit.unit)])
    return found if found is not None and improves(state.data, found, nominal) else None


def _refits(state: SearchState) -> Steps:
    """Refit suspects one at a time; if no refit explains the residual, refit from the estimates and in combinations."""
    yield from _single_refits(state)
    yield 0.4, "continuing the best refits"
    if _continue_best(state):
        return
    if not state.beats_unknown_law:
        yield from _refits_from_estimates(state)
    if not state.beats_unknown_law:
        yield from _towards(combined_refits(state), 0.85, 0.97, COMBINED)
        yield 0.97, "continuing the best refits"
        _continue_best(state)


def _single_refits(state: SearchState) -> Steps:
    """Refit the nominal model with each of the suspects with the strongest score tests, one at a time."""
    chosen = strongest_trials(state.data, state.trials, state.spec.refits)
    for k, trial in enumerate(chosen):
        if _is_outperformed(state, trial, chosen[0]):
            continue
        yield 0.3 + 0.1 * k / len(chosen), f"refit with {trial.suspect.name}"
        state.add(refit_with(state.context, state.fitted_nominal.refit.fit, [trial]))


def _refits_from_estimates(state: SearchState) -> Steps:
    """Refit from the estimates of the genes: suspects with the strongest score tests there, and those with a location.

    At the nominal fit a score test cannot see what the nominal genes have absorbed, such as a heavy mass. Suspects with
    a location and, on series, those that act within the simulation are also fitted from a large size. Choices, such as
    the start of the beat, change so much that a score test says little: those that fit better there are fitted too.
    """
    if state.initial_fit is None:
        raise ValueError("the nominal model has not been fitted")
    context, initial = state.initial_fit
    found, suspects = [], select_suspects(context.subject, state.spec.suspects)
    for k, (suspect, trials) in enumerate(score_tests(context, initial, suspects)):
        found.append(trials)
        yield 0.4 + 0.05 * (k + 1) / len(suspects), f"score test of {suspect.name} at the estimates"
    starts = [entry for trial in _restart_trials(state.data, found) for entry in start_points(trial)]
    starts += _choices(state.data, initial, found)
    if state.data.kind == "series":
        starts += [large_start(trial) for trial in _inner_trials(state)]
    else:
        local = [trials[0] for trials in found if trials and _has_location(trials[0].suspect)]
        starts += [large_start(trial, typical_shape=True) for trial in local]
    yield from _towards(_compete(state, starts), 0.45, 0.85, FIRST_STEPS * len(starts))


def _restart_trials(data: WhitenedData, found: Sequence[list[Trial]]) -> list[Trial]:
    """The strongest trials in ``found``, and, since few locations were tested, the best of each local suspect."""
    strongest = strongest_trials(data, found, MAX_RESTARTED)
    others = [trials[0] for trials in found if trials and all(trials[0] is not one for one in strongest)]
    return strongest + [one for one in others if _has_location(one.suspect)]


def _choices(data: WhitenedData, initial: Fit, found: Sequence[list[Trial]]) -> list[StartPoint]:
    """Return starts at each position of the suspects in ``found`` that are choices and fit better than ``initial``.

    Each has the shape with which it fits best while no gene adapts: to genes that may adapt without a limit, a wrong
    choice looks like a change of theirs.
    """
    starts = []

    def left(trial: Trial) -> float:
        return float(np.linalg.norm(data.whiten(initial.coefficients + trial.changes), axis=-1).min())

    for trials in found:
        if trials and trials[0].suspect.positions:
            best = min(trials, key=left)
            if left(best) < float(np.linalg.norm(data.whiten(initial.coefficients))):
                starts += [StartPoint((best,), units_at_position(best, *one)) for one in positions_of(best.suspect)]
    return starts


def _has_location(suspect: Suspect) -> bool:
    """Return whether ``suspect`` acts at a location of which a score test tries few, and not at a marker."""
    return bool(suspect.location_genes) and not suspect.candidate_shapes


def _inner_trials(state: SearchState) -> list[Trial]:
    """Return the best trial at the nominal fit of each suspect that acts within the simulation, at most MAX_INNER."""
    inner = [trials[0] for trials in state.trials if trials and trials[0].suspect.family not in FAULTS]
    return sorted(inner, key=lambda trial: -trial.gain)[:MAX_INNER]


def _compete(state: SearchState, starts: Sequence[StartPoint]) -> Iterator[str]:
    """Fit all ``starts`` from the estimates in competition, and store the best; yields the name of each stage."""
    if not starts or state.initial_fit is None:
        return
    policy, nominal = state.data.policy, state.fitted_nominal.refit.excess
    best = min((one.excess for one in state.refits), default=nominal)
    by_noise = tolerated_excess(state.data, 0.0, 0.0)
    limit = max(min(policy.worth_continuing * nominal, policy.rivalry * best), by_noise)
    target = max(policy.unknown_residual**2 * nominal, by_noise)
    rivals: list[tuple[StartPoint, Fit]] = []
    for rivals in fit_from_estimates(state.context, state.initial_fit[1], starts, limit, target):
        yield f"refit with {' and '.join(rivals[0][0].names)} from the estimates"
    for entry, fit in rivals:
        state.add(make_refit(state.data, fit, entry.trials))


def _refine_and_extend(state: SearchState) -> Iterator[str]:
    """Try a finer discretisation (its error may look like a second effect), then further effects; yields stages."""
    coarse = state.subject
    if state.spec.refine:
        refine_with_effects(state)
    if state.is_explained or not (state.beats_unknown_law or state.data.kind == "forces"):
        return
    yield from further_effects(state)
    if state.subject is coarse and not state.is_explained:
        yield from combined_refits(state)


def _continue_best(state: SearchState) -> bool:
    """Continue the best refits that have not converged and would need a second effect.

    Returns whether one of all refits needs none now.
    """
    enough, limit = state.partner_threshold, state.data.policy.worth_continuing * state.fitted_nominal.refit.excess
    for k in np.argsort([one.excess for one in state.refits])[:MAX_CONTINUED]:
        one = state.refits[k]
        if not one.fit.converged and enough < one.excess < limit:
            state.refits[k] = continue_fit(state.context, one)
    return state.is_explained


def _is_outperformed(state: SearchState, trial: Trial, best: Trial) -> bool:
    """Return whether ``trial`` is skipped: much weaker than ``best``, while a refit already explains the residual."""
    weak = trial.gain <= state.data.policy.weak_after_success * best.gain
    return weak and bool(state.refits) and state.is_explained
