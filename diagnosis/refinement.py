"""Fit the hypotheses of a search at a finer discretisation, whose error may become visible after a large effect."""

from __future__ import annotations

from dataclasses import replace

from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.nominal import Nominal, error_after, finer_change, finer_is_promising, improves
from wingfit.diagnosis.evidence.refit import Refit, continue_fit, fit_to_convergence, refit_at
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.verdict.weigh_hypotheses import tolerated_excess

MAX_CONTINUED = 2  # best refits that are continued until they converge


def refine_with_effects(state: SearchState) -> None:
    """Take a finer discretisation for all hypotheses where the best hypothesis fits better with it.

    The error of a discretisation may become visible only after a large effect is in the model.
    """
    data, nominal = state.data, state.fitted_nominal
    best = min((nominal.refit, *state.refits), key=lambda one: one.excess)
    if best is nominal.refit:
        return
    tried_finer, largest = nominal.tried_finer, 0.0
    limit = data.policy.rivalry * max(best.excess, 0.0) + tolerated_excess(data, 0.0, 0.0)
    leading = [one for one in state.by_excess if one.excess <= limit][:MAX_CONTINUED]
    for finer in state.context.finer():
        changes = [finer_change(finer, one) for one in leading]
        tried = [(one, _fit_at_finer(finer, one, *change)) for one, change in zip(leading, changes, strict=True)]
        known = [found for one, found in tried if found is not None and found is not one]
        if changes[0][0] > largest:
            largest, tried_finer = changes[0][0], finer.subject.description if known else nominal.tried_finer
        better = min(known, key=lambda one: one.excess, default=best)
        if improves(data, better, best):
            break
    else:
        state.nominal = replace(nominal, tried_finer="" if nominal.limited else tried_finer)
        return
    first = refit_at(finer, nominal.refit)
    if first is None:
        return
    first = fit_to_convergence(finer, first)
    limit = data.policy.rivalry * max(better.excess, 0.0) + tolerated_excess(data, 0.0, 0.0)
    near = [one for one in state.refits if one.excess <= limit or set(one.names) < set(better.names)]
    others = [one for one in near if one.names not in {found.names for found in known}]
    followed = [_follow(finer, one, better) for one in others]
    descriptions = f"{finer.subject.description} replaces {state.subject.description}"
    remark = f"with the effect added, the discretisation limits the model: {descriptions}"
    remarks = (*nominal.remarks, remark)
    change = finer_change(finer, nominal.refit)[0] if nominal.limited else 0.0
    remaining = error_after(change, nominal.refit, first) if change else None
    state.nominal = Nominal(finer.subject, first, remaining, "", remarks, limited=remaining is not None)
    state.context, state.refits = finer, [one for one in (*known, *followed) if one is not None]


def _fit_at_finer(finer: FitContext, refit: Refit, changes: float, gain: float) -> Refit | None:
    """Return ``refit`` fitted at the ``finer`` discretisation, unchanged if not promising; None if that fails.

    ``changes``, ``gain``: of :func:`finer_change`.
    """
    if not changes:
        return None
    if not finer_is_promising(finer.data, changes, gain, refit):
        return refit
    found = refit_at(finer, refit)
    if found is None or found.fit.converged or improves(finer.data, found, refit) or found.excess >= refit.excess:
        return found
    return continue_fit(finer, found)


def _follow(finer: FitContext, refit: Refit, best: Refit) -> Refit | None:
    """Fit ``refit`` at ``finer``, to convergence if ``best`` includes all its effects and more; None if that fails."""
    found = refit_at(finer, refit)
    if found is None or found.fit.converged or not set(refit.names) < set(best.names):
        return found
    return continue_fit(finer, found)
