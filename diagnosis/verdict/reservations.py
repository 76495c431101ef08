"""What speaks against a verdict: a misfit that remains, and held-out recordings that are not predicted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import NAMING, Proof, Verdict, amount
from wingfit.diagnosis.verdict.noise_doubt import noise_may_hide
from wingfit.diagnosis.verdict.verdict import Decision
from wingfit.diagnosis.verdict.weigh_hypotheses import (
    HypothesisWeights,
    beyond_chance,
    large_rest,
    leaves_a_rest,
    missed,
    nominal_refuted,
)
from wingfit.records import Series
from wingfit.rigs.suspect import Suspect

CLAIMING: tuple[Verdict, ...] = (*NAMING, "ambiguous")
WORTH_MENTIONING = 0.5  # of a misfit that an adequate model leaves: an effect that would remove more of it is mentioned
NO_GAIN = 0.1  # of the held-out misfit: effects that remove less of it are not named


def partly(decision: Decision, data: WhitenedData, nominal: Refit, floor: float) -> Decision:
    """Return a ``decision`` that names effects as "partly named" if they leave more than noise and the form of a law.

    ``floor`` (m or N): discretisation error.
    """
    if decision.verdict not in NAMING or not leaves_a_rest(data, nominal, decision.best, floor):
        return decision
    found = dict(decision.probabilities)
    found[decision.verdict], found["partly named"] = 0.0, found[decision.verdict]
    part = replace(decision, verdict="partly named", probabilities=found)
    return part if data.kind == "series" else _at_most(part, 1.0 - data.policy.partial_doubt)


def _at_most(decision: Decision, limit: float) -> Decision:
    """Return ``decision`` with at most the probability ``limit``; what is more goes to an unnamed cause."""
    found = dict(decision.probabilities)
    moved = max(found[decision.verdict] - limit, 0.0)
    found[decision.verdict], found["unnamed"] = found[decision.verdict] - moved, found["unnamed"] + moved
    return replace(decision, probabilities=found)


def remaining_sentence(data: WhitenedData, decision: Decision, best: Refit, floor: float, weighed: float) -> str:
    """Return a sentence on the misfit that the named effects, or an adequate model, leave; empty if it is negligible.

    An unnamed verdict speaks of nothing else. ``floor`` (m or N): discretisation error; ``weighed``: that with which
    the hypotheses were weighed.
    """
    size = float(np.sqrt(max(best.excess, 0.0)))
    if decision.verdict == "unnamed" or size <= data.policy.negligible * data.noise:
        return ""
    if decision.verdict == "adequate" and data.accepted:  # what accepted_sentence says
        return ""
    share = "" if data.unit == "noise" else f", {size / data.noise:.2g} times the noise"
    start = f" A misfit of {amount(size, data.unit)} beyond the noise remains{share}"
    if nominal_refuted(data, beyond_chance(data, best), weighed if decision.verdict == "adequate" else floor):
        return f"{start}: the law has another form, or something else is missing too."
    if large_rest(data, best, weighed):
        also = "" if decision.verdict == "adequate" else " too"
        return (
            f"{start}, more than noise usually makes: something may be missing{also}; record more beats and conditions."
        )
    if decision.verdict == "adequate" and missed(data, best, weighed):
        return f"{start}."
    return f"{start}, no more than errors of the noise and of the discretisation explain."


def doubted_by_discretisation(
    decision: Decision, data: WhitenedData, nominal: Refit, proven: float, weighed: float
) -> Decision:
    """Return an adequate ``decision`` with a limited probability where only an unproven error excuses its misfit.

    ``weighed`` (m or N): discretisation error with which the hypotheses were weighed; ``proven``: the part that fits of
    finer discretisations have shown. What they only might show excuses less (`Policy.doubted_noise`).
    """
    excused = _excused(decision, data, nominal, proven, weighed)
    return _at_most(decision, data.policy.doubted_noise) if excused else decision


def discretisation_sentence(
    decision: Decision, data: WhitenedData, nominal: Refit, proven: float, weighed: float
) -> str:
    """Return a sentence on what :func:`doubted_by_discretisation` doubts; else empty."""
    if not _excused(decision, data, nominal, proven, weighed):
        return ""
    return (
        " Only the discretisation may explain the residual, and no finer one was fitted: repeat the diagnosis with "
        "refinement."
    )


def _excused(decision: Decision, data: WhitenedData, nominal: Refit, proven: float, weighed: float) -> bool:
    def refuted(floor: float) -> bool:
        beyond = nominal_refuted(data, beyond_chance(data, nominal), floor)
        return beyond or large_rest(data, nominal, floor) or bool(missed(data, nominal, floor))

    return decision.verdict == "adequate" and refuted(proven) and not refuted(weighed)


def candidate_sentence(
    data: WhitenedData, decision: Decision, weights: HypothesisWeights, suspects: Mapping[str, Suspect]
) -> str:
    """Return a sentence on the effects that would remove most of what an adequate model leaves; else empty.

    ``suspects``: by name.
    """
    nominal, *others = weights.refits
    if decision.verdict != "adequate" or not others or nominal.excess <= (data.policy.negligible * data.noise) ** 2:
        return ""
    best = others[int(np.argmax(weights.evidence[1:]))]
    removed = 1.0 - max(best.excess, 0.0) / nominal.excess
    if removed < WORTH_MENTIONING:
        return ""
    titles = " with ".join(suspects[name].title.lower() for name in best.names)
    return f" Most of it, {100.0 * removed:.0f} %, would go with {titles}: too little evidence to add to the model."


def accepted_sentence(data: WhitenedData, decision: Decision, nominal: Refit, floor: float) -> str:
    """Return a sentence on the accepted error of series, if a model is adequate only because of it; else empty.

    ``floor``: discretisation error.
    """
    if decision.verdict != "adequate" or not data.accepted:
        return ""
    beyond = nominal.excess - (data.policy.negligible * data.noise) ** 2 - floor**2
    refuted_without = nominal_refuted(data, nominal.excess + data.accepted**2, floor)
    if beyond > data.accepted**2 or not refuted_without:
        return ""
    stated = {c.name: c for one in data.recordings if isinstance(one, Series) for c in one.quantities}
    errors = ", ".join(f"{c.accepted_error:.3g} {c.unit} in {c.name}" for c in stated.values() if c.accepted_error)
    return f" What exceeds the noise is within the accepted error: {errors}."


def missed_sentence(data: WhitenedData, decision: Decision, nominal: Refit, floor: float) -> str:
    """Return a sentence on recordings that a model misses although it is called adequate; else empty.

    ``floor`` (m or N): discretisation error.
    """
    found = missed(data, nominal, floor) if decision.verdict == "adequate" else {}
    if not found:
        return ""
    each = ", ".join(f"{name} by {size:.2g} times its noise" for name, size in found.items())
    others = ": something may act there that the others do not show" if len(found) < len(data.recordings) else ""
    return f" The model misses {each}{others}."


def noise_sentence(data: WhitenedData, decision: Decision, nominal: Refit) -> str:
    """Return a sentence on a noise that may hide missing physics, if the model is called adequate; else empty."""
    if decision.verdict != "adequate" or not noise_may_hide(data, nominal.fit):
        return ""
    return " The noise is not known well enough: see the remarks."


def judged_by_accepted_error(
    decision: Decision, data: WhitenedData, weights: HypothesisWeights, floor: float
) -> Decision:
    """Return an ambiguous ``decision`` on series without the probability of what leaves more than the accepted error.

    That probability becomes the one of an unnamed cause, which is the verdict if it prevails. ``floor``: discretisation
    error. Nothing changes where no accepted error is stated: then a misfit that remains may be that of a law which is
    nearly right.
    """
    if data.kind != "series" or decision.verdict != "ambiguous" or not data.accepted:
        return decision
    possible = [frozenset(one) for one in decision.alternatives]
    each = zip(weights.refits, weights.probabilities.tolist(), strict=True)
    listed = [(one.excess, probability) for one, probability in each if frozenset(one.names) in possible]
    enough = sum(probability for excess, probability in listed if not nominal_refuted(data, excess, floor))
    return without_names(decision, 1.0 - enough / sum(probability for _, probability in listed))


def without_names(decision: Decision, share: float = 1.0) -> Decision:
    """Return ``decision`` with a ``share`` of the probability of all names given to an unnamed cause.

    That is the verdict if it prevails.
    """
    found = dict(decision.probabilities)
    given = {name: share * found[name] for name in CLAIMING}
    found.update({name: found[name] - given[name] for name in CLAIMING}, unnamed=found["unnamed"] + sum(given.values()))
    if sum(found[name] for name in CLAIMING) > found["unnamed"]:
        return replace(decision, probabilities=found)
    return replace(decision, verdict="unnamed", probabilities=found, named=(), alternatives=())


def accepted_error_sentence(before: Decision, after: Decision) -> str:
    """Return a sentence on an ambiguous decision ``before`` that :func:`judged_by_accepted_error` made unnamed."""
    if before.verdict != "ambiguous" or after.verdict != "unnamed":
        return ""
    return " The effects that could be the cause leave more than the accepted error, except improbable ones."


def doubted_by_held_out(
    decision: Decision, proved: Proof | None, data: WhitenedData, *, refuted: bool = False, none_predicts: bool = False
) -> Decision:
    """Return ``decision`` with less certainty where held-out recordings contradict it.

    A model that they refute (``refuted``) is not adequate. One that does not predict them otherwise is adequate with a
    limited probability (`Policy.doubted_noise`). Effects with which they are predicted no better are not named. Where
    recordings with a beat are not predicted with the effects either, those have a limited probability as well
    (`Policy.partial_doubt`). Several of which each may be the cause are then not named, provided that none of them
    predicts (``none_predicts``).
    """
    if refuted and decision.verdict == "adequate":
        return replace(_at_most(decision, 0.0), verdict="unnamed", named=(), alternatives=())
    if _useless(decision, proved):
        return without_names(decision)
    if none_predicts:
        return without_names(decision, 1.0 - data.policy.partial_doubt)
    if unpredicted(decision, proved, data):
        adequate = decision.verdict == "adequate"
        return _at_most(decision, data.policy.doubted_noise if adequate else 1.0 - data.policy.partial_doubt)
    return decision


def held_out_sentence(
    before: Decision,
    proved: Proof | None,
    data: WhitenedData,
    *,
    refuted: bool = False,
    none_predicts: bool = False,
) -> str:
    """Return a sentence on held-out recordings that contradict ``before``, the decision without them; else empty."""
    if proved is None:
        return ""
    if refuted and before.verdict == "adequate":
        return (
            " The fitted recordings do not show it, but the held-out ones do: their misfit is "
            f"{proved.before.value:.3g} times the floor, more than noise and the errors of the genes explain."
        )
    if _useless(before, proved):
        return (
            " It is not named, because with it the held-out recordings are predicted no better: their misfit is "
            f"{proved.before.value:.3g} times the floor before, and {proved.after.value:.3g} after."
        )
    if none_predicts:
        return (
            " Effects that could be the cause are not named, because none of them predicts the held-out recordings: "
            f"with the most probable one their misfit is {proved.after.value:.3g} times the floor."
        )
    if not unpredicted(before, proved, data):
        return ""
    if before.verdict == "adequate":
        return (
            f" But it does not predict the held-out recordings: their misfit is {proved.before.value:.3g} times the "
            "floor. Something is missing or wrong there, or the fitted recordings do not determine the genes."
        )
    return " But held-out recordings are still missed: what is named may be wrong, or only a part."


def unpredicted(decision: Decision, proved: Proof | None, data: WhitenedData) -> bool:
    """Return whether an adequate model, or one with effects that may be the cause, does not predict what is held out.

    Effects in series are not judged: no trials show how often they are wrong then.
    """
    if proved is None or decision.verdict == "unnamed" or (decision.verdict != "adequate" and data.kind == "series"):
        return False
    misfit = proved.before if decision.verdict == "adequate" else proved.after
    return (misfit.value if misfit.low is None else misfit.low) > data.policy.unpredicted


def _useless(decision: Decision, proved: Proof | None) -> bool:
    if decision.verdict not in CLAIMING or proved is None:
        return False
    missed = proved.before.value > 1.0 + NO_GAIN  # else there is nothing to gain
    return missed and not proved.improved and proved.after.value > (1.0 - NO_GAIN) * proved.before.value
