"""Advise what to record next after a diagnosis."""

from __future__ import annotations

from collections.abc import Iterator

from wingfit.diagnosis.advice.advised import Advice
from wingfit.diagnosis.advice.in_beat import InBeat
from wingfit.diagnosis.advice.in_series import InSeries
from wingfit.diagnosis.advice.proposal import Proposal, ranked
from wingfit.diagnosis.advice.rivals import Rivals
from wingfit.diagnosis.advice.settling import Settling
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights


def advise(
    context: FitContext, weights: HypothesisWeights, floor: float, *, rest: bool = False
) -> Iterator[tuple[float, tuple[Advice, ...]]]:
    """Compare what could be recorded next; yields the fraction done and the advice so far, best first.

    ``floor``: error of the discretisation, m or N; ``rest``: whether the question is what is missing beside a named
    effect.
    """
    rivals = Rivals.among(context.data, weights)
    settling = Settling(context.data, weights, rivals.numbers, floor)
    search = (InSeries if context.data.kind == "series" else InBeat)(context, rivals, settling)
    found = list[Proposal]()
    for part, new in search.proposals():
        found += new
        yield part, ranked(found, rivals.names, rivals.words, rest=rest) if found else ()
