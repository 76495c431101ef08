"""A proposal what to record next, and the order in which proposals are reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wingfit.diagnosis.advice.advised import Advice, AdviceKind, AdvisedCondition, AdvisedCost
from wingfit.records import Condition
from wingfit.records.array_types import Array, Float

MAX_ADVICE = 5  # proposals that are reported
MOST_OF_KIND = 2
ALIKE = 0.02  # difference of probabilities that is not worth a more expensive recording
SETTLES = 0.05  # increase of the probability that is worth four times as many beats


@dataclass(frozen=True)
class Proposal:
    """A recording that could be made.

    Attributes:
        kind: of the proposal.
        what: the recording in words, such as "record 12 Hz".
        separation: of the nearest rival from the most probable hypothesis (:class:`.advised.Advice`).
        resolves: probability that it settles which hypothesis is right; None if it cannot be computed.
        cost: of the recording.
        details: further fields of the advice, by name.
    """

    kind: AdviceKind
    what: str
    separation: float
    resolves: float | None
    cost: AdvisedCost
    details: dict[str, Any] = field(default_factory=dict)


def ranked(proposals: Sequence[Proposal], names: tuple[str, ...], titles: str, *, rest: bool) -> tuple[Advice, ...]:
    """Return up to MAX_ADVICE of ``proposals`` as advice: the most probable to settle it first, cheap before dear.

    ``names`` and ``titles`` of the hypotheses that they distinguish; ``rest``: whether the question is what is missing
    beside a named effect, which no hypothesis predicts.
    """
    chosen, of_kind = list[Proposal](), dict[str, int]()
    for one in sorted(proposals, key=_order):
        of_kind[one.kind] = of_kind.get(one.kind, 0) + 1
        if of_kind[one.kind] <= MOST_OF_KIND:
            chosen.append(one)
    return tuple(_advice(one, names, titles, rest=rest) for one in chosen[:MAX_ADVICE])


def _order(one: Proposal) -> tuple[float, float, float]:
    return -np.round((one.resolves or 0.0) / ALIKE), one.cost.seconds, -one.separation


def _advice(one: Proposal, names: tuple[str, ...], titles: str, *, rest: bool) -> Advice:
    words = f"{one.what} ({cost_in_words(one.cost)}): "
    words += f"there the predictions of {titles} differ by {one.separation:.2g} sigma"
    resolves = None if rest else one.resolves
    if rest:
        words += "; whether it shows what else is missing cannot be computed, since no hypothesis predicts that"
    elif resolves is None:
        words += "; how probably it decides cannot be computed"
    else:
        words += f"; it decides with a probability of {in_words(resolves)}"
    return Advice(words, one.separation, resolves, names, kind=one.kind, cost=one.cost, **one.details)


def in_words(probability: float) -> str:
    """Return ``probability`` in whole per cent; less than 1 and more than 99 as such, since it is an estimate."""
    percent = 100.0 * probability
    return "less than 1 %" if percent < 1.0 else "more than 99 %" if percent > 99.0 else f"{percent:.0f} %"


def cost_in_words(cost: AdvisedCost) -> str:
    """Return ``cost`` as text."""
    span = f"{cost.seconds:.2g} s" if cost.seconds < 100.0 else f"{cost.seconds / 60.0:.2g} min"
    size = f"{cost.frames} samples" if cost.beats is None else f"{cost.beats:.3g} beats"
    return f"{size}, {span}"


def nearest(apart: Float[Array, "K K"]) -> float:
    """Return the least root mean square separation of a rival from the first hypothesis."""
    return float(np.sqrt(apart[0, 1:].min()))


def condition_in_words(condition: Condition) -> str:
    """Return the settings of a flapping rig as text."""
    lag, incidence = np.degrees(condition.phase_lag), np.degrees(condition.angle_of_attack)
    where = f"{condition.flap_frequency:.3g} Hz, {lag:.3g} deg of lag, {condition.pressure / 100.0:.4g} mbar"
    return where + (f", {condition.airspeed:.3g} m/s at {incidence:.3g} deg" if condition.airspeed > 0 else "")


def advised_condition(condition: Condition) -> AdvisedCondition:
    """Return ``condition`` for the finding."""
    lag, incidence = float(np.degrees(condition.phase_lag)), float(np.degrees(condition.angle_of_attack))
    return AdvisedCondition(condition.flap_frequency, lag, condition.pressure / 100.0, condition.airspeed, incidence)
