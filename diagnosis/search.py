"""The search for what is lacking: nominal fit, score tests, refits alone and together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis.evidence.competing_fits import StartPoint, fit_from_estimates, start_points
from wingfit.diagnosis.evidence.fit import FIT_ERRORS, Fit
from wingfit.diagnosis.evidence.nominal import (
    Nominal,
    choose_discretisation,
    finer_change,
    finer_is_promising,
    fit_nominal,
    is_clearly_better,
)
from wingfit.diagnosis.evidence.refit import (
    FINAL_STEPS,
    Refit,
    continue_fit,
    fit_to_convergence,
    make_refit,
    partner_trials,
    refit_with_subject,
    refit_with_suspects,
    restart_fit,
    strongest_trials,
    substitute_trials,
    suspect_pairs,
)
from wingfit.diagnosis.evidence.screen import Trial, score_tests
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.diagnosis.subject import Subject, Suspect
from wingfit.diagnosis.verdict.verdict import decide
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, nominal_suffices, tolerated_excess, weigh

MAX_CONTINUED = 2  # of the best refits, if they have not converged
MAX_RESTARTED = 3  # suspects that are fitted from the estimates
MAX_PARTNERS = 3  # of the best explanation
MAX_RIVALS = 3  # explanations to which a partner is sought
MAX_SUBSTITUTES = 2  # tried in place of each part of an explanation of several


def search_missing_physics(
    state: SearchState, spec: DiagnosisSpec, free: tuple[str, ...], evaluator: Evaluator
) -> Iterator[tuple[float, str]]:
    """Fill ``state``; yields the part of the work done and what comes next."""
    data, fixed = state.data, spec.calibration.fixed
    yield 0.0, "fitting the nominal model"
    if spec.start:
        with suppress(*FIT_ERRORS):
            state.initial_fit = state.subject, next(fit_nominal(state.subject, data, evaluator, free, {}, fixed))
    for k, fit in enumerate(fit_nominal(state.subject, data, evaluator, free, spec.start, fixed)):
        state.initial_fit = state.initial_fit or (state.subject, fit)
        yield 0.25 * (1.0 - 0.85 ** (k + 1)), "fitting the nominal model"
    yield 0.25, "comparing with a finer division"
    suspects = select_suspects(state.subject, spec)
    for fraction, stage in _search_per_discretisation(state, spec, fit, suspects, evaluator):
        yield 0.3 + 0.55 * fraction, stage
    yield 0.85, "fitting the nominal model again"
    better = _nominal_from_best(state, evaluator)
    if better is not None:
        state.restart_from(replace(state.fitted_nominal, refit=better))
        for fraction, stage in _test_and_refit_suspects(state, spec, suspects, evaluator):
            yield 0.85 + 0.07 * fraction, stage
    yield 0.92, "comparing with a finer division"
    for stage in _refine_and_extend(state, spec, evaluator):
        yield 0.93, stage
    yield 0.94, "continuing the best refits"
    if state.refits:
        _continue_best(state, state.fitted_nominal, evaluator)
    floor = 0.0 if spec.refine else state.fitted_nominal.discretisation_error or 0.0
    yield from ((0.95, stage) for stage in _final_fits(state, evaluator, floor, len(suspects)))


def _search_per_discretisation(
    state: SearchState, spec: DiagnosisSpec, fit: Fit, suspects: Sequence[Suspect], evaluator: Evaluator
) -> Iterator[tuple[float, str]]:
    """Suspects beside the nominal ``fit``; where a finer division does better than all of these, beside that one's."""
    nominal = choose_discretisation(state.subject, state.data, evaluator, fit, refine=spec.refine)
    if nominal.subject is not state.subject and not nominal_suffices(state.data, nominal.refit, len(suspects)):
        state.restart_from(choose_discretisation(state.subject, state.data, evaluator, fit, refine=False))
        for fraction, stage in _test_and_refit_suspects(state, spec, suspects, evaluator, at_least=nominal.refit):
            yield 0.3 * fraction, stage
    if not any(is_clearly_better(state.data, one, nominal.refit) for one in state.refits):
        state.restart_from(nominal)
        for fraction, stage in _test_and_refit_suspects(state, spec, suspects, evaluator):
            yield 0.3 + 0.7 * fraction, stage


def _final_fits(state: SearchState, evaluator: Evaluator, floor: float, suspects: int) -> Iterator[str]:
    """Weigh what there is, with the best explanation fitted to its end, and what is hard to tell from it as well."""
    known = weigh(state.data, state.fitted_nominal.refit, state.refits, floor, suspects)
    yield from _compete(state, evaluator, _indistinguishable(known) or _look_alikes(state, decide(known).best))
    yield "fitting the best explanation to its end"
    for _ in range(MAX_CONTINUED):
        state.weights = weigh(state.data, state.fitted_nominal.refit, state.refits, floor, suspects)
        unended = _unconverged(state.weights)
        if unended is None:
            return
        state.add(continue_fit(state.subject, state.data, evaluator, unended, FINAL_STEPS))
    state.weights = weigh(state.data, state.fitted_nominal.refit, state.refits, floor, suspects)


def _indistinguishable(weights: HypothesisWeights) -> list[StartPoint]:
    """Suspects that explain nearly as well each by itself, if several do: the right one's fit may have been caught."""
    evidence = weights.evidence[1:]
    least = max(evidence.max(initial=0.0) - weights.policy.overtake, 0.0)
    close = [one for one, found in zip(weights.refits[1:], evidence, strict=True) if found > least]
    several = len(close) > 1 and all(len(one.trials) == 1 for one in close)
    return [entry for one in close for entry in start_points(one.trials[0])] if several else []


def _look_alikes(state: SearchState, best: Refit) -> list[StartPoint]:
    """An explanation that leaves more than noise, with what is known to look like a part of it in its place.

    A score test cannot tell what the nominal genes, and a look-alike, have taken up: of two that look alike the first
    to be fitted may hide the other.
    """
    if best.excess <= tolerated_excess(state.data, 0.0, 0.0):
        return []
    found = {trials[0].suspect.name: trials[0] for trials in state.trials if trials}
    every = []
    for part in best.trials:
        beside = [trial for trial in best.trials if trial is not part]
        for name in part.suspect.confused_with:
            if name in found and name not in best.names:
                every += start_points(found[name], beside, best)
    return every


def _unconverged(weights: HypothesisWeights) -> Refit | None:
    """The best explanation if its fit has not ended, else the first such rival that might overtake it."""
    best = decide(weights).best
    if best.trials and not (best.fit.converged and best.fit.jacobian_measured):
        return best
    evidence = weights.evidence[1:]
    for k in np.argsort(-evidence, kind="stable")[: MAX_RIVALS if best.trials else 0]:
        rival: Refit = weights.refits[1:][k]
        if evidence[k] > evidence.max() - weights.policy.overtake and not rival.fit.converged:
            return rival
    return None


def _refine_with_effects(state: SearchState, nominal: Nominal, evaluator: Evaluator) -> None:
    """Go to the finer division with all explanations where that does better with the best of them.

    Beside a large effect a division's own misfit does not show before the effect is in the model.
    """
    data = state.data
    best = min((nominal.refit, *state.refits), key=lambda one: one.excess)
    if best is nominal.refit:
        return
    ineffective_refinement, most = (
        nominal.ineffective_refinement,
        data.policy.rivalry * best.excess + tolerated_excess(data, 0.0, 0.0),
    )
    leading = sorted((one for one in state.refits if one.excess <= most), key=lambda one: one.excess)[:MAX_CONTINUED]
    for finer in nominal.subject.finer_subjects():
        tried = [(one, _fit_at_finer(finer, data, evaluator, one)) for one in leading]
        if any(found is not None and found is not one for one, found in tried):
            ineffective_refinement = finer.description
        known = [found for one, found in tried if found is not None and found is not one]
        better = min(known, key=lambda one: one.excess, default=best)
        if is_clearly_better(state.data, better, best):
            break
    else:
        state.nominal = replace(nominal, ineffective_refinement=ineffective_refinement)
        return
    first = refit_with_subject(finer, data, evaluator, nominal.refit)
    if first is None:
        return
    first = fit_to_convergence(finer, data, evaluator, first)
    most = data.policy.rivalry * better.excess + tolerated_excess(data, 0.0, 0.0)
    near = [one for one in state.refits if one.excess <= most or set(one.names) < set(better.names)]
    others = [one for one in near if one.names not in {found.names for found in known}]
    followed = [_follow_to_finer(finer, data, evaluator, one, better) for one in others]
    remark = f"the division limits the model beside the effect: {finer.description} was taken instead of {state.subject.description}"
    remarks = (*nominal.remarks, remark)  # what the finer division itself leaves is not known
    state.nominal = Nominal(finer, first, None, "", remarks)
    state.subject, state.refits = finer, [one for one in (*known, *followed) if one is not None]


def _fit_at_finer(finer: Subject, data: WhitenedData, evaluator: Evaluator, refit: Refit) -> Refit | None:
    """``refit`` at a finer division, fitted where that promises to do better; None where it cannot be simulated."""
    changes, takes = finer_change(finer, data, evaluator, refit)
    if not changes:
        return None
    if not finer_is_promising(data, changes, takes, refit):
        return refit
    found = refit_with_subject(finer, data, evaluator, refit)
    if found is None or found.fit.converged or is_clearly_better(data, found, refit) or found.excess >= refit.excess:
        return found
    return continue_fit(finer, data, evaluator, found)


def _follow_to_finer(
    finer: Subject, data: WhitenedData, evaluator: Evaluator, refit: Refit, best: Refit
) -> Refit | None:
    """``refit`` at a finer division; to its end where it is part of the ``best``, lest it lose for want of steps."""
    found = refit_with_subject(finer, data, evaluator, refit)
    if found is None or found.fit.converged or not set(refit.names) < set(best.names):
        return found
    return continue_fit(finer, data, evaluator, found)


def _test_and_refit_suspects(
    state: SearchState,
    spec: DiagnosisSpec,
    suspects: Sequence[Suspect],
    evaluator: Evaluator,
    at_least: Refit | None = None,
) -> Iterator[tuple[float, str]]:
    """Score tests about the nominal fit, then refits; yields the part of that done.

    Few or no refits where none does, or promises to do, better than the nominal model of a finer division
    (``at_least``): a division may take up what an effect leaves, as an effect may take up what a division leaves.
    """
    nominal = state.fitted_nominal
    for k, (suspect, trials) in enumerate(
        score_tests(state.subject, state.data, nominal.refit.fit, evaluator, suspects)
    ):
        state.trials.append(trials)
        yield 0.6 * (k + 1) / len(suspects), f"score test of {suspect.name}"
    if nominal_suffices(state.data, nominal.refit, len(suspects)):
        return
    least = min((trial.remaining_chi_squared for trials in state.trials for trial in trials), default=np.inf)
    if at_least is None or least < state.data.chi_squared(at_least.fit.coefficients):
        yield from _refits(state, nominal, spec, evaluator, at_least)


def _nominal_from_best(state: SearchState, evaluator: Evaluator) -> Refit | None:
    """The nominal model fitted from where the best explanation ended, if it does much better there.

    An explanation may lead out of a minimum in which the nominal fit was caught, and is not the cause then.
    """
    nominal = state.fitted_nominal.refit
    best = min(state.refits, key=lambda one: one.excess, default=nominal)
    if best is nominal or not is_clearly_better(state.data, best, nominal):
        return None
    found = restart_fit(state.subject, state.data, evaluator, nominal, best.fit.unit[: len(nominal.fit.unit)])
    return found if found is not None and is_clearly_better(state.data, found, nominal) else None


def _refits(
    state: SearchState, nominal: Nominal, spec: DiagnosisSpec, evaluator: Evaluator, at_least: Refit | None
) -> Iterator[tuple[float, str]]:
    """Suspects one by one, from the estimates where none could be named, and together where that is not enough."""
    yield from _single_refits(state, nominal, spec, evaluator)
    yield 0.72, "continuing the best refits"
    if _continue_best(state, nominal, evaluator):
        return
    if at_least is not None and not any(is_clearly_better(state.data, one, at_least) for one in state.refits):
        return
    if not state.beats_unknown_law:
        yield from _refits_from_estimates(state, spec, evaluator)
    if not state.beats_unknown_law:
        yield from ((0.82, stage) for stage in _combined_refits(state, nominal, evaluator))
        yield 0.97, "continuing the best refits"
        _continue_best(state, nominal, evaluator)


def _single_refits(
    state: SearchState, nominal: Nominal, spec: DiagnosisSpec, evaluator: Evaluator
) -> Iterator[tuple[float, str]]:
    data, fit = state.data, nominal.refit.fit
    chosen = strongest_trials(state.data, state.trials, spec.refits)
    for k, trial in enumerate(chosen):
        if _is_outperformed(state, nominal, trial, chosen[0]):
            continue
        yield 0.6 + 0.12 * k / len(chosen), f"refit with {trial.suspect.name}"
        state.add(refit_with_suspects(state.subject, data, fit, evaluator, [trial]))


def _refits_from_estimates(
    state: SearchState, spec: DiagnosisSpec, evaluator: Evaluator
) -> Iterator[tuple[float, str]]:
    """Suspects that explain most about the estimates, from there.

    About the nominal fit a score test cannot see what its genes went far to make up for, such as a heavy mass.
    """
    if state.initial_fit is None:
        raise ValueError("the nominal model has not been fitted")
    subject, initial = state.initial_fit
    found = []
    for suspect, trials in score_tests(subject, state.data, initial, evaluator, select_suspects(subject, spec)):
        found.append(trials)
        yield 0.74, f"score test of {suspect.name} about the estimates"
    every = [entry for trial in _restart_trials(state.data, found) for entry in start_points(trial)]
    yield from ((0.77, stage) for stage in _compete(state, evaluator, every))


def _restart_trials(data: WhitenedData, found: Sequence[list[Trial]]) -> list[Trial]:
    """The strongest, and all that act at a place: a score test at a few places tells little of these."""
    strongest = strongest_trials(data, found, MAX_RESTARTED)
    placed = [
        trials[0]
        for trials in found
        if trials and trials[0].suspect.location_genes and not trials[0].suspect.candidate_shapes
    ]
    return [*strongest, *(trial for trial in placed if all(trial is not one for one in strongest))]


def _compete(state: SearchState, evaluator: Evaluator, every: Sequence[StartPoint]) -> Iterator[str]:
    """Keep what is in front when all have been fitted from the estimates."""
    if not every or state.initial_fit is None:
        return
    best = min(one.excess for one in state.refits)
    noisy = tolerated_excess(state.data, 0.0, 0.0)
    most = max(
        min(state.data.policy.hopeful * state.fitted_nominal.refit.excess, state.data.policy.rivalry * best), noisy
    )
    wanted = max(state.data.policy.unknown_residual**2 * state.fitted_nominal.refit.excess, noisy)
    front: list[tuple[StartPoint, Fit]] = []
    for front in fit_from_estimates(state.subject, state.data, evaluator, state.initial_fit[1], every, most, wanted):
        yield f"refit with {' and '.join(front[0][0].names)} from the estimates"
    for entry, fit in front:
        state.add(make_refit(state.data, fit, entry.trials))


def _refine_and_extend(state: SearchState, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[str]:
    """The best explanation at a division that does not limit it, and what else is lacking if it leaves little then.

    In this order: what a division leaves beside an effect may pass for a second one.
    """
    coarse = state.subject
    if spec.refine:
        _refine_with_effects(state, state.fitted_nominal, evaluator)
    if state.beats_unknown_law and not state.is_explained(state.fitted_nominal):
        yield from _second_effects(state, spec, evaluator)
        if state.subject is coarse and not state.is_explained(state.fitted_nominal):
            yield from _combined_refits(state, state.fitted_nominal, evaluator)


def _second_effects(state: SearchState, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[str]:
    """Partners of the best explanation, by score tests about it."""
    best, data = min(state.refits, key=lambda one: one.excess), state.data
    others, found = [one for one in select_suspects(state.subject, spec) if one.name not in best.names], []
    for suspect, trials in score_tests(state.subject, data, best.fit, evaluator, others, best.names):
        found.append(trials)
        yield f"score test of {suspect.name} beside {' and '.join(best.names)}"
    for trial in partner_trials(data, best, found)[:MAX_PARTNERS]:
        yield f"refit with {' and '.join((*best.names, trial.suspect.name))}"
        state.add(refit_with_suspects(state.subject, data, best.fit, evaluator, [*best.trials, trial], best.fit))


def _combined_refits(state: SearchState, nominal: Nominal, evaluator: Evaluator) -> Iterator[str]:
    """Several at once: partners of the best, pairs of which neither explains much, and each part exchanged."""
    data, fit = state.data, nominal.refit.fit
    tried = {frozenset(one.names) for one in state.refits}
    best = sorted(state.refits, key=lambda one: one.excess)[:MAX_RIVALS]
    for k, one in enumerate(best):
        for trial in partner_trials(data, one, state.trials)[: MAX_PARTNERS if k == 0 else 1]:
            names = frozenset((*one.names, trial.suspect.name))
            if names not in tried:
                tried.add(names)
                yield f"refit with {' and '.join(sorted(names))}"
                state.add(refit_with_suspects(state.subject, data, fit, evaluator, [*one.trials, trial], one.fit))
    least = min(data.chi_squared(one.fit.coefficients) for one in state.refits)
    for two in suspect_pairs(data, fit, state.trials, least, 2):
        names = frozenset(trial.suspect.name for trial in two)
        if names not in tried:
            tried.add(names)
            yield f"refit with {' and '.join(sorted(names))}"
            state.add(refit_with_suspects(state.subject, data, fit, evaluator, two))
    yield from _substituted_refits(state, nominal, evaluator)


def _substituted_refits(state: SearchState, nominal: Nominal, evaluator: Evaluator) -> Iterator[str]:
    """Each part of the best explanation exchanged for what can do the same: one of two may have been found first."""
    best = min(state.refits, key=lambda one: one.excess)
    if len(best.trials) < 2:
        return
    tried = {frozenset(one.names) for one in state.refits}
    for part in best.trials:
        others = [trial for trial in best.trials if trial is not part]
        for trial in substitute_trials(state.data, evaluator, best, part, state.trials, MAX_SUBSTITUTES):
            names = frozenset(one.suspect.name for one in (*others, trial))
            if names not in tried:
                yield f"refit with {' and '.join(sorted(names))}"
                state.add(
                    refit_with_suspects(state.subject, state.data, nominal.refit.fit, evaluator, [*others, trial])
                )


def _continue_best(state: SearchState, nominal: Nominal, evaluator: Evaluator) -> bool:
    """Whether an explanation leaves so little that none needs a partner; the best are continued until one does."""
    enough = state.partner_threshold(nominal)
    for k in np.argsort([one.excess for one in state.refits])[:MAX_CONTINUED]:
        one = state.refits[k]
        if not one.fit.converged and enough < one.excess < state.data.policy.hopeful * nominal.refit.excess:
            state.refits[k] = continue_fit(state.subject, state.data, evaluator, one)
    return state.is_explained(nominal)


def _is_outperformed(state: SearchState, nominal: Nominal, trial: Trial, best: Trial) -> bool:
    """Whether a refit has explained so much already that a trial so much weaker in its score test cannot compete."""
    if not state.refits or trial.gain > state.data.policy.weaker * best.gain:
        return False
    left = min(one.excess for one in state.refits)
    return left <= max(state.data.policy.solved * nominal.refit.excess, tolerated_excess(state.data, 0.0, 0.0))


def select_suspects(subject: Subject, spec: DiagnosisSpec) -> list[Suspect]:
    """The suspects that ``spec`` asks for; ValueError for one that the rig has not."""
    known = {suspect.name: suspect for suspect in subject.suspects}
    for name in spec.suspects:
        if name not in known:
            raise ValueError(f"unknown suspect {name!r}: take it out; for this rig there are {', '.join(known)}")
    return [suspect for name, suspect in known.items() if not spec.suspects or name in spec.suspects]
