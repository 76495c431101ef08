"""Likely mistakes of a dataset and the effects that describe them."""

from __future__ import annotations

from typing import Any, cast, get_args

import pytest

from wingfit.checks.mistake import Kind, Mistake
from wingfit.diagnosis.finding import Verdict
from wingfit.diagnosis.verdict.mistakes import DESCRIBED_BY, doubted_by_mistakes, mistakes_sentence
from wingfit.diagnosis.verdict.verdict import Decision
from wingfit.sim.effects.registry import EFFECTS


def decision(verdict: Verdict, *named: str) -> Decision:
    shares = dict.fromkeys(("adequate", "named", "partly named", "ambiguous", "measurement fault", "unnamed"), 0.0)
    shares[verdict], shares["unnamed"] = 0.99, shares["unnamed"] + 0.01
    return Decision(verdict, shares, named, (), cast("Any", None))


def mistake(kind: Kind) -> Mistake:
    return Mistake(kind, "dataset", "one", "another", "a slip", "the key")


def test_each_effect_that_describes_a_mistake_is_in_the_library() -> None:
    assert set(DESCRIBED_BY) <= set(get_args(Kind))
    assert {name for names in DESCRIBED_BY.values() for name in names} <= set(EFFECTS)


def test_an_effect_that_describes_the_mistake_is_named() -> None:
    sure = decision("measurement fault", "axis_swap")
    assert doubted_by_mistakes(sure, (mistake("force axes"),)) == sure
    either = decision("ambiguous", "body_pitch_convention", "axis_sign")
    assert doubted_by_mistakes(either, (mistake("force axes"),)) == either


@pytest.mark.parametrize("verdict", ["named", "partly named", "ambiguous", "measurement fault"])
def test_other_effects_are_not_named(verdict: Verdict) -> None:
    sure = decision(verdict, "stroke_bias")
    found = doubted_by_mistakes(sure, (mistake("vertical sign"),))
    assert (found.verdict, found.named) == ("unnamed", ())
    assert found.probabilities["unnamed"] == pytest.approx(0.01 + 0.7 * 0.99)
    assert "until then" in mistakes_sentence(sure, found, (mistake("vertical sign"),))


@pytest.mark.parametrize("verdict", ["adequate", "unnamed"])
def test_verdicts_without_names_stay(verdict: Verdict) -> None:
    sure = decision(verdict)
    found = doubted_by_mistakes(sure, (mistake("vertical sign"),))
    assert found == sure
    sentence = mistakes_sentence(sure, found, (mistake("vertical sign"),))
    assert ("vertical sign" in sentence, "until then" in sentence) == (verdict == "unnamed", False)


def test_a_dataset_without_mistakes_is_not_doubted() -> None:
    sure = decision("named", "stroke_bias")
    assert doubted_by_mistakes(sure, ()) == sure
    assert doubted_by_mistakes(sure, (mistake("duplicate"),)) == sure
    assert mistakes_sentence(sure, sure, ()) == ""
