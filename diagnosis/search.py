"""The search for what is lacking: nominal fit, score tests, refits alone and together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis.evidence.competing_fits import Entry, afresh, entries
from wingfit.diagnosis.evidence.fit import UNFIT, Fit
from wingfit.diagnosis.evidence.nominal import Nominal, first_fit, improves, leaves, promises, settled
from wingfit.diagnosis.evidence.refit import (
    LAST,
    Refit,
    again,
    continued,
    ended,
    judged,
    pairs,
    partners,
    refitted,
    resumed,
    substitutes,
    worth_a_refit,
)
from wingfit.diagnosis.evidence.screen import Trial, screened
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.search_state import Assessment
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.diagnosis.subject import Subject, Suspect
from wingfit.diagnosis.verdict.verdict import decided
from wingfit.diagnosis.verdict.weigh_hypotheses import Weighed, beyond_doubt, tolerated, weighed

CONTINUED = 2  # of the best refits, if they have not converged
RUNNERS = 3  # suspects that are fitted from the estimates
PARTNERS = 3  # of the best explanation
RIVALS = 3  # explanations to which a partner is sought
SUBSTITUTES = 2  # tried in place of each part of an explanation of several


def assess(
    state: Assessment, spec: DiagnosisSpec, free: tuple[str, ...], evaluator: Evaluator
) -> Iterator[tuple[float, str]]:
    """Fill ``state``; yields the part of the work done and what comes next."""
    stack, fixed = state.stack, spec.calibration.fixed
    yield 0.0, "fitting the nominal model"
    if spec.start:
        with suppress(*UNFIT):
            state.begun = state.subject, next(first_fit(state.subject, stack, evaluator, free, {}, fixed))
    for k, fit in enumerate(first_fit(state.subject, stack, evaluator, free, spec.start, fixed)):
        state.begun = state.begun or (state.subject, fit)
        yield 0.25 * (1.0 - 0.85 ** (k + 1)), "fitting the nominal model"
    yield 0.25, "comparing with a finer division"
    suspects = suspected(state.subject, spec)
    for fraction, stage in _settled(state, spec, fit, suspects, evaluator):
        yield 0.3 + 0.55 * fraction, stage
    yield 0.85, "fitting the nominal model again"
    better = _elsewhere(state, evaluator)
    if better is not None:
        state.begin(replace(state.known, refit=better))
        for fraction, stage in _suspected(state, spec, suspects, evaluator):
            yield 0.85 + 0.07 * fraction, stage
    yield 0.92, "comparing with a finer division"
    for stage in _completed(state, spec, evaluator):
        yield 0.93, stage
    yield 0.94, "continuing the best refits"
    if state.refits:
        _solved(state, state.known, evaluator)
    floor = 0.0 if spec.refine else state.known.division or 0.0
    yield from ((0.95, stage) for stage in _ended(state, evaluator, floor, len(suspects)))


def _settled(
    state: Assessment, spec: DiagnosisSpec, fit: Fit, suspects: Sequence[Suspect], evaluator: Evaluator
) -> Iterator[tuple[float, str]]:
    """Suspects beside the nominal ``fit``; where a finer division does better than all of these, beside that one's."""
    nominal = settled(state.subject, state.stack, evaluator, fit, refine=spec.refine)
    if nominal.subject is not state.subject and not beyond_doubt(state.stack, nominal.refit, len(suspects)):
        state.begin(settled(state.subject, state.stack, evaluator, fit, refine=False))
        for fraction, stage in _suspected(state, spec, suspects, evaluator, at_least=nominal.refit):
            yield 0.3 * fraction, stage
    if not any(improves(state.stack, one, nominal.refit) for one in state.refits):
        state.begin(nominal)
        for fraction, stage in _suspected(state, spec, suspects, evaluator):
            yield 0.3 + 0.7 * fraction, stage


def _ended(state: Assessment, evaluator: Evaluator, floor: float, suspects: int) -> Iterator[str]:
    """Weigh what there is, with the best explanation fitted to its end, and what is hard to tell from it as well."""
    known = weighed(state.stack, state.known.refit, state.refits, floor, suspects)
    yield from _raced(state, evaluator, _alike(known) or _exchanges(state, decided(known).best))
    yield "fitting the best explanation to its end"
    for _ in range(CONTINUED):
        state.weighed = weighed(state.stack, state.known.refit, state.refits, floor, suspects)
        unended = _unended(state.weighed)
        if unended is None:
            return
        state.add(continued(state.subject, state.stack, evaluator, unended, LAST))
    state.weighed = weighed(state.stack, state.known.refit, state.refits, floor, suspects)


def _alike(weighed: Weighed) -> list[Entry]:
    """Suspects that explain nearly as well each by itself, if several do: the right one's fit may have been caught."""
    evidence = weighed.evidence[1:]
    least = max(evidence.max(initial=0.0) - weighed.policy.overtake, 0.0)
    close = [one for one, found in zip(weighed.refits[1:], evidence, strict=True) if found > least]
    several = len(close) > 1 and all(len(one.trials) == 1 for one in close)
    return [entry for one in close for entry in entries(one.trials[0])] if several else []


def _exchanges(state: Assessment, best: Refit) -> list[Entry]:
    """An explanation that leaves more than noise, with what is known to look like a part of it in its place.

    A score test cannot tell what the nominal genes, and a look-alike, have taken up: of two that look alike the first
    to be fitted may hide the other.
    """
    if best.excess <= tolerated(state.stack, 0.0, 0.0):
        return []
    found = {trials[0].suspect.name: trials[0] for trials in state.trials if trials}
    every = []
    for part in best.trials:
        beside = [trial for trial in best.trials if trial is not part]
        for name in part.suspect.alike:
            if name in found and name not in best.names:
                every += entries(found[name], beside, best)
    return every


def _unended(weighed: Weighed) -> Refit | None:
    """The best explanation if its fit has not ended, else the first such rival that might overtake it."""
    best = decided(weighed).best
    if best.trials and not (best.fit.converged and best.fit.fresh):
        return best
    evidence = weighed.evidence[1:]
    for k in np.argsort(-evidence, kind="stable")[: RIVALS if best.trials else 0]:
        rival: Refit = weighed.refits[1:][k]
        if evidence[k] > evidence.max() - weighed.policy.overtake and not rival.fit.converged:
            return rival
    return None


def _refined(state: Assessment, nominal: Nominal, evaluator: Evaluator) -> None:
    """Go to the finer division with all explanations where that does better with the best of them.

    Beside a large effect a division's own misfit does not show before the effect is in the model.
    """
    stack = state.stack
    best = min((nominal.refit, *state.refits), key=lambda one: one.excess)
    if best is nominal.refit:
        return
    innocent, most = nominal.innocent, stack.policy.rivalry * best.excess + tolerated(stack, 0.0, 0.0)
    leading = sorted((one for one in state.refits if one.excess <= most), key=lambda one: one.excess)[:CONTINUED]
    for finer in nominal.subject.finer():
        tried = [(one, _at_finer(finer, stack, evaluator, one)) for one in leading]
        if any(found is not None and found is not one for one, found in tried):
            innocent = finer.told
        known = [found for one, found in tried if found is not None and found is not one]
        better = min(known, key=lambda one: one.excess, default=best)
        if improves(state.stack, better, best):
            break
    else:
        state.nominal = replace(nominal, innocent=innocent)
        return
    first = again(finer, stack, evaluator, nominal.refit)
    if first is None:
        return
    first = ended(finer, stack, evaluator, first)
    most = stack.policy.rivalry * better.excess + tolerated(stack, 0.0, 0.0)
    near = [one for one in state.refits if one.excess <= most or set(one.names) < set(better.names)]
    others = [one for one in near if one.names not in {found.names for found in known}]
    followed = [_followed(finer, stack, evaluator, one, better) for one in others]
    remark = f"the division limits the model beside the effect: {finer.told} was taken instead of {state.subject.told}"
    remarks = (*nominal.remarks, remark)  # what the finer division itself leaves is not known
    state.nominal = Nominal(finer, first, None, "", remarks)
    state.subject, state.refits = finer, [one for one in (*known, *followed) if one is not None]


def _at_finer(finer: Subject, stack: Stack, evaluator: Evaluator, refit: Refit) -> Refit | None:
    """``refit`` at a finer division, fitted where that promises to do better; None where it cannot be simulated."""
    changes, takes = leaves(finer, stack, evaluator, refit)
    if not changes:
        return None
    if not promises(stack, changes, takes, refit):
        return refit
    found = again(finer, stack, evaluator, refit)
    if found is None or found.fit.converged or improves(stack, found, refit) or found.excess >= refit.excess:
        return found
    return continued(finer, stack, evaluator, found)


def _followed(finer: Subject, stack: Stack, evaluator: Evaluator, refit: Refit, best: Refit) -> Refit | None:
    """``refit`` at a finer division; to its end where it is part of the ``best``, lest it lose for want of steps."""
    found = again(finer, stack, evaluator, refit)
    if found is None or found.fit.converged or not set(refit.names) < set(best.names):
        return found
    return continued(finer, stack, evaluator, found)


def _suspected(
    state: Assessment,
    spec: DiagnosisSpec,
    suspects: Sequence[Suspect],
    evaluator: Evaluator,
    at_least: Refit | None = None,
) -> Iterator[tuple[float, str]]:
    """Score tests about the nominal fit, then refits; yields the part of that done.

    Few or no refits where none does, or promises to do, better than the nominal model of a finer division
    (``at_least``): a division may take up what an effect leaves, as an effect may take up what a division leaves.
    """
    nominal = state.known
    for k, (suspect, trials) in enumerate(screened(state.subject, state.stack, nominal.refit.fit, evaluator, suspects)):
        state.trials.append(trials)
        yield 0.6 * (k + 1) / len(suspects), f"score test of {suspect.name}"
    if beyond_doubt(state.stack, nominal.refit, len(suspects)):
        return
    least = min((trial.leaves for trials in state.trials for trial in trials), default=np.inf)
    if at_least is None or least < state.stack.chi_squared(at_least.fit.coefficients):
        yield from _refits(state, nominal, spec, evaluator, at_least)


def _elsewhere(state: Assessment, evaluator: Evaluator) -> Refit | None:
    """The nominal model fitted from where the best explanation ended, if it does much better there.

    An explanation may lead out of a minimum in which the nominal fit was caught, and is not the cause then.
    """
    nominal = state.known.refit
    best = min(state.refits, key=lambda one: one.excess, default=nominal)
    if best is nominal or not improves(state.stack, best, nominal):
        return None
    found = resumed(state.subject, state.stack, evaluator, nominal, best.fit.unit[: len(nominal.fit.unit)])
    return found if found is not None and improves(state.stack, found, nominal) else None


def _refits(
    state: Assessment, nominal: Nominal, spec: DiagnosisSpec, evaluator: Evaluator, at_least: Refit | None
) -> Iterator[tuple[float, str]]:
    """Suspects one by one, from the estimates where none could be named, and together where that is not enough."""
    yield from _alone(state, nominal, spec, evaluator)
    yield 0.72, "continuing the best refits"
    if _solved(state, nominal, evaluator):
        return
    if at_least is not None and not any(improves(state.stack, one, at_least) for one in state.refits):
        return
    if not state.leaves_little:
        yield from _afresh(state, spec, evaluator)
    if not state.leaves_little:
        yield from ((0.82, stage) for stage in _together(state, nominal, evaluator))
        yield 0.97, "continuing the best refits"
        _solved(state, nominal, evaluator)


def _alone(
    state: Assessment, nominal: Nominal, spec: DiagnosisSpec, evaluator: Evaluator
) -> Iterator[tuple[float, str]]:
    stack, fit = state.stack, nominal.refit.fit
    chosen = worth_a_refit(state.stack, state.trials, spec.refits)
    for k, trial in enumerate(chosen):
        if _outdone(state, nominal, trial, chosen[0]):
            continue
        yield 0.6 + 0.12 * k / len(chosen), f"refit with {trial.suspect.name}"
        state.add(refitted(state.subject, stack, fit, evaluator, [trial]))


def _afresh(state: Assessment, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[tuple[float, str]]:
    """Suspects that explain most about the estimates, from there.

    About the nominal fit a score test cannot see what its genes went far to make up for, such as a heavy mass.
    """
    if state.begun is None:
        raise ValueError("the nominal model has not been fitted")
    subject, begun = state.begun
    found = []
    for suspect, trials in screened(subject, state.stack, begun, evaluator, suspected(subject, spec)):
        found.append(trials)
        yield 0.74, f"score test of {suspect.name} about the estimates"
    every = [entry for trial in _runners(state.stack, found) for entry in entries(trial)]
    yield from ((0.77, stage) for stage in _raced(state, evaluator, every))


def _runners(stack: Stack, found: Sequence[list[Trial]]) -> list[Trial]:
    """The strongest, and all that act at a place: a score test at a few places tells little of these."""
    strongest = worth_a_refit(stack, found, RUNNERS)
    placed = [trials[0] for trials in found if trials and trials[0].suspect.places and not trials[0].suspect.spots]
    return [*strongest, *(trial for trial in placed if all(trial is not one for one in strongest))]


def _raced(state: Assessment, evaluator: Evaluator, every: Sequence[Entry]) -> Iterator[str]:
    """Keep what is in front when all have been fitted from the estimates."""
    if not every or state.begun is None:
        return
    best = min(one.excess for one in state.refits)
    noisy = tolerated(state.stack, 0.0, 0.0)
    most = max(min(state.stack.policy.hopeful * state.known.refit.excess, state.stack.policy.rivalry * best), noisy)
    wanted = max(state.stack.policy.unknown_residual**2 * state.known.refit.excess, noisy)
    front: list[tuple[Entry, Fit]] = []
    for front in afresh(state.subject, state.stack, evaluator, state.begun[1], every, most, wanted):
        yield f"refit with {' and '.join(front[0][0].names)} from the estimates"
    for entry, fit in front:
        state.add(judged(state.stack, fit, entry.trials))


def _completed(state: Assessment, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[str]:
    """The best explanation at a division that does not limit it, and what else is lacking if it leaves little then.

    In this order: what a division leaves beside an effect may pass for a second one.
    """
    coarse = state.subject
    if spec.refine:
        _refined(state, state.known, evaluator)
    if state.leaves_little and not state.enough(state.known):
        yield from _beside(state, spec, evaluator)
        if state.subject is coarse and not state.enough(state.known):
            yield from _together(state, state.known, evaluator)


def _beside(state: Assessment, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[str]:
    """Partners of the best explanation, by score tests about it."""
    best, stack = min(state.refits, key=lambda one: one.excess), state.stack
    others, found = [one for one in suspected(state.subject, spec) if one.name not in best.names], []
    for suspect, trials in screened(state.subject, stack, best.fit, evaluator, others, best.names):
        found.append(trials)
        yield f"score test of {suspect.name} beside {' and '.join(best.names)}"
    for trial in partners(stack, best, found)[:PARTNERS]:
        yield f"refit with {' and '.join((*best.names, trial.suspect.name))}"
        state.add(refitted(state.subject, stack, best.fit, evaluator, [*best.trials, trial], best.fit))


def _together(state: Assessment, nominal: Nominal, evaluator: Evaluator) -> Iterator[str]:
    """Several at once: partners of the best, pairs of which neither explains much, and each part exchanged."""
    stack, fit = state.stack, nominal.refit.fit
    tried = {frozenset(one.names) for one in state.refits}
    best = sorted(state.refits, key=lambda one: one.excess)[:RIVALS]
    for k, one in enumerate(best):
        for trial in partners(stack, one, state.trials)[: PARTNERS if k == 0 else 1]:
            names = frozenset((*one.names, trial.suspect.name))
            if names not in tried:
                tried.add(names)
                yield f"refit with {' and '.join(sorted(names))}"
                state.add(refitted(state.subject, stack, fit, evaluator, [*one.trials, trial], one.fit))
    least = min(stack.chi_squared(one.fit.coefficients) for one in state.refits)
    for two in pairs(stack, fit, state.trials, least, 2):
        names = frozenset(trial.suspect.name for trial in two)
        if names not in tried:
            tried.add(names)
            yield f"refit with {' and '.join(sorted(names))}"
            state.add(refitted(state.subject, stack, fit, evaluator, two))
    yield from _exchanged(state, nominal, evaluator)


def _exchanged(state: Assessment, nominal: Nominal, evaluator: Evaluator) -> Iterator[str]:
    """Each part of the best explanation exchanged for what can do the same: one of two may have been found first."""
    best = min(state.refits, key=lambda one: one.excess)
    if len(best.trials) < 2:
        return
    tried = {frozenset(one.names) for one in state.refits}
    for part in best.trials:
        others = [trial for trial in best.trials if trial is not part]
        for trial in substitutes(state.stack, evaluator, best, part, state.trials, SUBSTITUTES):
            names = frozenset(one.suspect.name for one in (*others, trial))
            if names not in tried:
                yield f"refit with {' and '.join(sorted(names))}"
                state.add(refitted(state.subject, state.stack, nominal.refit.fit, evaluator, [*others, trial]))


def _solved(state: Assessment, nominal: Nominal, evaluator: Evaluator) -> bool:
    """Whether an explanation leaves so little that none needs a partner; the best are continued until one does."""
    enough = state.tolerable(nominal)
    for k in np.argsort([one.excess for one in state.refits])[:CONTINUED]:
        one = state.refits[k]
        if not one.fit.converged and enough < one.excess < state.stack.policy.hopeful * nominal.refit.excess:
            state.refits[k] = continued(state.subject, state.stack, evaluator, one)
    return state.enough(nominal)


def _outdone(state: Assessment, nominal: Nominal, trial: Trial, best: Trial) -> bool:
    """Whether a refit has explained so much already that a trial so much weaker in its score test cannot compete."""
    if not state.refits or trial.gain > state.stack.policy.weaker * best.gain:
        return False
    left = min(one.excess for one in state.refits)
    return left <= max(state.stack.policy.solved * nominal.refit.excess, tolerated(state.stack, 0.0, 0.0))


def suspected(subject: Subject, spec: DiagnosisSpec) -> list[Suspect]:
    """The suspects that ``spec`` asks for; ValueError for one that the rig has not."""
    known = {suspect.name: suspect for suspect in subject.suspects}
    for name in spec.suspects:
        if name not in known:
            raise ValueError(f"unknown suspect {name!r}: take it out; for this rig there are {', '.join(known)}")
    return [suspect for name, suspect in known.items() if not spec.suspects or name in spec.suspects]
