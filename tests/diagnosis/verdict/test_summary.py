"""The sentences of a verdict."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from tests.diagnosis.verdict.refits import data, refit
from wingfit.diagnosis.finding import Interval
from wingfit.diagnosis.location.differences import cause_location
from wingfit.diagnosis.verdict.verdict import decide, summary
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, weigh


def test_the_summary_lists_alternatives_and_additional_effects() -> None:
    suspects = cast("Any", {name: SimpleNamespace(title=f"The {name}") for name in "abc"})
    texts = dict.fromkeys(("before", "after", "noise", "where", "held_out"), "")
    alike = [refit(0.30, ("a", "c"), 1), refit(0.30, ("a", "b"), 1)]
    nested = [refit(0.46, ("a",)), refit(0.30, ("a", "b"), 1)]
    either, more = (summary(decide(weigh(data(), refit(2.0), r, 0.0, 40)), suspects, texts) for r in (alike, nested))
    assert "cannot distinguish: the a with the c or the a with the b." in either
    assert "The model is missing the a. Whether the b is missing as well is undecided." in more
    rival = decide(weigh(data(), refit(2.0), [refit(0.30, ("a",)), refit(0.31, ("b",), 2)], 0.0, 40))
    assert "The model is missing the a. Less probable alternatives: the b." in summary(rival, suspects, texts)


def test_a_summary_calls_a_model_adequate_only_if_it_is_likely() -> None:
    texts = dict.fromkeys(("before", "after", "noise", "where", "held_out"), "")
    refits, found = (refit(1.0),), []
    for unknown in (0.05, 0.4):
        shares = np.array([1.0 - unknown])
        decision = decide(HypothesisWeights(refits, np.log(shares), shares, unknown, np.array([1.0])))
        assert decision.verdict == "adequate"
        found.append(summary(decision, {}, texts))
    assert found[0].startswith("The model is adequate: ")
    assert found[1].startswith("The model may be adequate (probability 0.60): ")


def test_a_summary_does_not_say_that_nothing_explains_what_an_effect_may_explain() -> None:
    suspects = cast("Any", {"a": SimpleNamespace(title="The a")})
    texts = dict.fromkeys(("before", "after", "noise", "where", "held_out"), "")
    refits, found = (refit(5.0), refit(1.5, ("a",))), []
    for known in (0.7, 0.1):
        shares = np.array([0.0, known])
        decision = decide(HypothesisWeights(refits, np.array([0.0, 9.0]), shares, 1.0 - known, np.array([24.0, 1.5])))
        assert decision.verdict == "unnamed"
        found.append(summary(decision, suspects, texts))
    assert found[0].startswith("Physics is missing, and whether an effect of the library explains it is not certain: ")
    assert found[0].endswith(
        " That effects of the library are the cause has a probability of 0.70, too little for a name."
    )
    assert found[1].startswith("Physics is missing that no effect of the library explains: ")
    assert "probability" not in found[1]


def test_the_location_of_a_cause_has_an_interval() -> None:
    span, phase = Interval(0.85, 0.37, 0.9), Interval(1.25, 1.2, 1.3)
    assert cause_location(span, Interval(0.5, None, None), phase) == (
        "; its cause acts at 85 % of the span (37 to 90 %), 50 % of the chord, 0.25 of the beat (0.20 to 0.30)"
    )
    assert cause_location(None, None, None) == ""
