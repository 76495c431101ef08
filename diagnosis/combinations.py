"""Refits with several effects together: partners, further effects, substitutes, and pairs where requested or needed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.refit import (
    Refit,
    fit_to_convergence,
    partner_trials,
    refit_with,
    refit_without,
    substitute_trials,
    suspect_pairs,
)
from wingfit.diagnosis.evidence.screen import Trial, score_tests
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.verdict.weigh_hypotheses import weigh

MAX_PARTNERS = 3  # second effects that are tried with the best hypothesis
MAX_RIVALS = 3  # hypotheses for which a second effect is tried
EXTENDED = {"tracks": (1, 1), "series": (1, 1), "forces": (6, 2)}  # hypotheses that get a further effect, and rounds
MAX_SUBSTITUTES = 2  # effects that are tried in place of each effect of a combined hypothesis


def further_effects(state: SearchState) -> Iterator[str]:
    """Refit the leading hypotheses together with each further effect that score tests at their own fits propose.

    At the nominal fit, an effect may change nothing that it changes beside another one.
    """
    bases, rounds = EXTENDED[state.data.kind]
    extended: set[frozenset[str]] = set()
    for _ in range(rounds):
        for base in _leading(state, bases):
            if frozenset(base.names) not in extended:
                extended.add(frozenset(base.names))
                yield from _with_further_effect(state, base)
        if state.is_explained:
            return


def _leading(state: SearchState, count: int) -> list[Refit]:
    """Return the refit with the least excess, then those with most evidence, ``count`` in all."""
    first = state.by_excess[0]
    if count == 1:
        return [first]
    suspects = len(state.suspects)
    weights = weigh(state.data, state.fitted_nominal.refit, state.refits, 0.0, suspects)
    order = np.argsort(-weights.evidence[1:], kind="stable")
    return [first, *(one for k in order if (one := state.refits[k]) is not first)][:count]


def _with_further_effect(state: SearchState, base: Refit) -> Iterator[str]:
    """Refit ``base`` together with each of the effects that score tests at its fit propose; yields stages."""
    if state.data.kind == "forces":
        base = fit_to_convergence(state.context, base)
        state.add(base)
    others, found = [one for one in state.suspects if one.name not in base.names], []
    for suspect, trials in score_tests(state.context, base.fit, others, base.names):
        found.append(trials)
        yield f"score test of {suspect.name} together with {' and '.join(base.names)}"
    for trial in partner_trials(state.data, base, found)[:MAX_PARTNERS]:
        yield f"refit with {' and '.join((*base.names, trial.suspect.name))}"
        state.add(refit_with(state.context, base.fit, [*base.trials, trial], base.fit))


def combined_refits(state: SearchState) -> Iterator[str]:
    """Refit the best hypotheses with a second effect, pairs of weak effects, and combinations with one replaced."""
    data, tried = state.data, {frozenset(one.names) for one in state.refits}
    for k, one in enumerate(state.by_excess[:MAX_RIVALS]):
        for trial in partner_trials(data, one, state.trials)[: MAX_PARTNERS if k == 0 else 1]:
            yield from _refit_untried(state, tried, [*one.trials, trial], one.fit)
    least = min(data.chi_squared(one.fit.coefficients) for one in state.refits)
    for two in suspect_pairs(data, state.fitted_nominal.refit.fit, state.trials, least, 2):
        yield from _refit_untried(state, tried, two)
    yield from _substituted_refits(state)


def _refit_untried(
    state: SearchState, tried: set[frozenset[str]], trials: Sequence[Trial], base: Fit | None = None
) -> Iterator[str]:
    """Refit with the suspects of ``trials``, unless the set of their names is in ``tried``; add it there."""
    names = frozenset(trial.suspect.name for trial in trials)
    if names not in tried:
        tried.add(names)
        yield f"refit with {' and '.join(sorted(names))}"
        state.add(refit_with(state.context, state.fitted_nominal.refit.fit, trials, base))


def _substituted_refits(state: SearchState) -> Iterator[str]:
    """Refit the best combination with each of its effects replaced by effects that can reproduce the same change."""
    best = state.by_excess[0]
    if len(best.trials) < 2:
        return
    tried = {frozenset(one.names) for one in state.refits}
    for part in best.trials:
        others = [trial for trial in best.trials if trial is not part]
        for trial in substitute_trials(state.context, best, part, state.trials, MAX_SUBSTITUTES):
            yield from _refit_untried(state, tried, [*others, trial])


def singles_and_pairs(state: SearchState, bases: int | None = None) -> Iterator[tuple[float, str]]:
    """Fit each suspect alone and each pair of them that was not fitted yet; yields the fraction done and the stage.

    A pair starts from the better of its two single fits, at which the other effect is score-tested, or from the nominal
    fit where neither has one. ``bases``: only pairs with one of so many of the best single fits.
    """
    tried = {frozenset(one.names) for one in state.refits}
    found = [trials[0] for trials in state.trials if trials]
    whole = max(len(found) * (len(found) - 1) // 2, 1) if bases is None else max(bases * (len(found) - 1), 1)

    def done(stage: str) -> tuple[float, str]:
        return min(sum(len(names) == 2 for names in tried) / whole, 1.0), stage

    for trial in found:
        yield from map(done, _refit_untried(state, tried, [trial]))
    singles = [one for one in state.by_excess if len(one.trials) == 1][:bases]
    for base in [fit_to_convergence(state.context, one) for one in singles]:
        state.add(base)
        others = [one for one in state.suspects if frozenset((*base.names, one.name)) not in tried]
        for _, trials in score_tests(state.context, base.fit, others, base.names):
            if trials:
                yield from map(done, _refit_untried(state, tried, [*base.trials, trials[0]], base.fit))
    for k, one in enumerate(found if bases is None else []):
        for other in found[:k]:
            yield from map(done, _refit_untried(state, tried, [one, other]))


def smaller_refits(state: SearchState) -> Iterator[str]:
    """Refit the best of three effects or more without each of them: one that was added early may be needed no longer.

    Of forces, also where these were fitted from other genes: a minimum without an effect that is nearly zero cannot be
    worse than with it. Not of tracks: the trials of wings, which never needed it, were done without it.
    """
    best = state.by_excess[0] if state.refits else None
    if state.data.kind == "tracks" or best is None or len(best.trials) < 3:
        return
    tried = {frozenset(one.names) for one in state.refits} if state.data.kind == "series" else set()
    for part in best.trials:
        names = [name for name in best.names if name != part.suspect.name]
        if frozenset(names) not in tried:
            yield f"refit with {' and '.join(sorted(names))}"
            state.add(refit_without(state.context, best, part))
