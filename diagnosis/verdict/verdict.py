"""Decide the verdict from the probabilities of the hypotheses, and describe it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.diagnosis.evidence.intervals import gene_values
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.screen import Trial
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import CONFIDENT, NAMING, UNCERTAIN, VERDICTS, Hypothesis, Verdict, of_the_library
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights
from wingfit.rigs.suspect import Suspect

MAX_SCREENED_LISTED = 12  # suspects that were only score-tested and are still listed


@dataclass(frozen=True)
class Decision:
    """The verdict and the probabilities of all verdicts.

    ``named``: names of the effects that the verdict names; ``alternatives``: the effects of each possible hypothesis,
    if there are several; ``best``: the fit of the model called "after".
    """

    verdict: Verdict
    probabilities: dict[str, float]
    named: tuple[str, ...]
    alternatives: tuple[tuple[str, ...], ...]
    best: Refit


def decide(weights: HypothesisWeights) -> Decision:
    """Return the verdict that the probabilities of the hypotheses imply."""
    policy = weights.policy
    nominal, effects = float(weights.probabilities[0]), weights.probabilities[1:]
    refits = weights.refits[1:]
    probability: dict[str, float] = dict.fromkeys(VERDICTS, 0.0)
    probability["adequate"], probability["unnamed"] = nominal, weights.unknown
    total = float(effects.sum())
    possible: list[Refit] = []
    best = weights.refits[0]
    if len(effects):
        top = int(np.argmax(effects))
        possible = [refits[k] for k in np.argsort(-effects) if effects[k] >= policy.possible * max(total, 1e-300)]
        certain = refits[top] if effects[top] >= policy.single * total else _common_subset(possible)
        one: Verdict = "measurement fault" if certain and is_measurement_fault(certain) else "named"
        if certain:
            contained = [set(certain.names) <= set(refit.names) for refit in refits]
            probability[one] = float(effects[contained].sum())
        probability["ambiguous"] = total - probability[one]
    missing = total + weights.unknown
    verdict: Verdict
    if nominal >= missing:
        verdict = "adequate"
    elif total >= policy.listed * missing:
        verdict, best = (one, certain) if certain else ("ambiguous", refits[top])
    else:
        verdict = "unnamed"
        if weights.evidence[1:].max(initial=0.0) > policy.least_evidence:  # worth its genes
            best = refits[int(np.argmax(weights.evidence[1:]))]
    listed = verdict not in ("adequate", "unnamed") and len(possible) > 1
    alternatives = tuple(refit.names for refit in possible) if listed else ()
    if verdict == "ambiguous":
        named = tuple(dict.fromkeys(name for refit in possible for name in refit.names))
    else:
        named = best.names if verdict in NAMING else ()
    return Decision(verdict, probability, named, alternatives, best)


def _common_subset(possible: Sequence[Refit]) -> Refit | None:
    """Return the hypothesis in ``possible`` whose effects all others include as well; None if there is none."""
    return next((one for one in possible if all(set(one.names) <= set(other.names) for other in possible)), None)


def hypotheses(
    data: WhitenedData, weights: HypothesisWeights, trials: Sequence[Sequence[Trial]], decision: Decision
) -> tuple[Hypothesis, ...]:
    """Return all weighed hypotheses, most probable first, then suspects that were only score-tested (``trials``).

    Their probabilities are those of the last ``decision``, which may have been doubted after weighing.
    """
    before, weights = weights.probabilities, _as_decided(weights, decision)
    order = np.lexsort((-before, -weights.probabilities))
    gains = {one[0].suspect.name: one[0] for one in trials if one}
    refitted = [_refitted_hypothesis(data, weights, int(k), gains) for k in order]
    known = {refit.names for refit in weights.refits}
    screened = sorted((t for name, t in gains.items() if (name,) not in known), key=lambda t: -t.gain)
    start = max(weights.refits[0].excess, 0.0) / data.noise**2
    return (*refitted, *(_screened_hypothesis(trial, start, data) for trial in screened[:MAX_SCREENED_LISTED]))


def _as_decided(weights: HypothesisWeights, decision: Decision) -> HypothesisWeights:
    """Return ``weights`` with the probability of effects shared as before, and its sum as in ``decision``."""
    adequate, unknown = decision.probabilities["adequate"], decision.probabilities["unnamed"]
    effects = weights.probabilities[1:]
    whole = float(effects.sum())
    shared = effects * (max(1.0 - adequate - unknown, 0.0) / whole) if whole > 0.0 else effects
    return replace(weights, probabilities=np.array([adequate, *shared]), unknown=unknown)


def _refitted_hypothesis(
    data: WhitenedData, weights: HypothesisWeights, k: int, gains: Mapping[str, Trial]
) -> Hypothesis:
    refit, nominal = weights.refits[k], weights.refits[0]
    suspects = [trial.suspect for trial in refit.trials]
    own = {gene.name for suspect in suspects for gene in suspect.genes}
    predicted = None
    if refit.predicted is not None and nominal.predicted is not None:
        predicted = explained_fraction(refit.predicted, nominal.predicted)
    return Hypothesis(
        effects=refit.names,
        title=" and ".join(s.title for s in suspects) or "No missing physics",
        family=suspects[0].family if suspects else "",
        source="; ".join(s.source for s in suspects),
        signature="; ".join(s.signature for s in suspects),
        probability=float(weights.probabilities[k]),
        evidence=float(weights.evidence[k]),
        score=sum(gains[s.name].gain for s in suspects if s.name in gains),
        freedom=refit.freedom,
        explained=explained_fraction(refit.excess, nominal.excess),
        predicted=predicted,
        misfit=float(np.sqrt(max(refit.excess, 0.0) + data.noise**2)),
        refitted=True,
        genes=tuple(gene for gene in gene_values(data, refit) if gene.name in own),
    )


def explained_fraction(remaining: float, before: float) -> float:
    """Return the fraction of the excess ``before`` that is removed; zero where there was none."""
    return float(np.clip(1.0 - max(remaining, 0.0) / before, -1.0, 1.0)) if before > 0.0 else 0.0


def explained_in_score_test(trial: Trial, data: WhitenedData) -> float:
    """Return the fraction of the excess that the suspect of ``trial`` would explain, as its score test predicts."""
    samples = len(data.scale)
    by_chance = np.sqrt(2.0 * samples)  # of chi-squared
    return float(np.clip(trial.gain / max(trial.gain + trial.remaining_chi_squared - samples, by_chance), 0.0, 1.0))


def _screened_hypothesis(trial: Trial, start: float, data: WhitenedData) -> Hypothesis:
    suspect, explained = trial.suspect, explained_in_score_test(trial, data)
    remaining = max(start * (1.0 - explained), 0.0)
    return Hypothesis(
        (suspect.name,),
        suspect.title,
        suspect.family,
        suspect.source,
        suspect.signature,
        0.0,
        0.0,
        trial.gain,
        trial.freedom,
        explained,
        None,
        float(data.noise * np.sqrt(1.0 + remaining)),
        False,
    )


def is_measurement_fault(refit: Refit) -> bool:
    """Return whether all effects of the hypothesis ``refit`` are faults of the measurement."""
    return bool(refit.trials) and all(trial.suspect.family == "measurement" for trial in refit.trials)


def summary(decision: Decision, suspects: Mapping[str, Suspect], texts: Mapping[str, str]) -> str:
    """Return the verdict in a few sentences.

    ``suspects``: by name; ``texts``: the misfits "before" and "after" and the "noise" with units, "where" the misfit
    lies, and a sentence on the recordings "held_out".
    """
    names, nearest = (_titles(suspects, found) for found in (decision.named, decision.best.names))
    start = f"The misfit of the refitted nominal model is {texts['before']}; the noise is {texts['noise']}."
    if decision.verdict == "adequate":
        probability = decision.probabilities["adequate"]
        if probability < CONFIDENT:
            return (
                f"The model may be adequate (probability {probability:.2f}): these recordings show no missing physics, "
                f"and cannot exclude it. {start}"
            )
        return f"The model is adequate: these recordings show no missing physics. {start}"
    if decision.verdict == "unnamed":
        found = of_the_library(decision.probabilities)
        what, doubt = "Physics is missing that no effect of the library explains", ""
        if found >= UNCERTAIN:
            what = "Physics is missing, and whether an effect of the library explains it is not certain"
            doubt = (
                f" That effects of the library are the cause has a probability of {found:.2f}, too little for a name."
            )
        return f"{what}: {texts['where']}. {start} " + (
            f"The best effect, {nearest}, reduces the misfit to {texts['after']}.{doubt}"
            if nearest
            else "No effect explains enough to be worth its genes, and none was added."
        )
    if decision.verdict == "ambiguous":
        either = " or ".join(_titles(suspects, found, " with ") for found in decision.alternatives) or names
        return (
            f"Physics is missing, and these recordings cannot distinguish: {either}. {start} "
            f"With the most probable the misfit is {texts['after']}. {texts['held_out']}"
        )
    fault = is_measurement_fault(decision.best)
    kind, link = ("the recordings have a fault", ": ") if fault else ("the model is missing", " ")
    kind, part = kind.capitalize(), ", and that is only a part" if decision.verdict == "partly named" else ""
    named = set(decision.named)
    larger = [one for one in decision.alternatives if named <= set(one)]
    others = [one for one in decision.alternatives if not named <= set(one)]
    additional = dict.fromkeys(name for one in larger for name in one if name not in decision.named)
    alternatives = [
        _titles(suspects, one, " with ") + (" alone or beside something unknown" if set(one) < named else "")
        for one in others
    ]
    more = (
        f" Whether {_titles(suspects, list(additional), ' or ')} is missing as well is undecided." if additional else ""
    )
    more += f" Less probable alternatives: {' or '.join(alternatives)}." if alternatives else ""
    return f"{kind}{link}{names}{part}.{more} {start} With it the misfit is {texts['after']}. {texts['held_out']}"


def _titles(suspects: Mapping[str, Suspect], names: Sequence[str], between: str = " and ") -> str:
    return between.join(suspects[name].title.lower() for name in names if name in suspects)
