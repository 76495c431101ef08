"""Verdicts that are not sure: a misfit that noise rarely makes, a beat that changes, an effect that may be zero."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from tests.diagnosis.verdict.refits import data, refit
from wingfit.diagnosis.finding import Interval
from wingfit.diagnosis.policy import POLICY
from wingfit.diagnosis.verdict import weigh_hypotheses
from wingfit.diagnosis.verdict.reservations import discretisation_sentence, doubted_by_discretisation
from wingfit.diagnosis.verdict.verdict import _as_decided, decide
from wingfit.diagnosis.verdict.weigh_hypotheses import nominal_suffices, weigh


def test_a_model_is_not_surely_adequate_where_it_leaves_what_noise_rarely_makes() -> None:
    """Forces of four recordings: noise could make a misfit larger than itself, so none of this size is refuted."""
    few = data(4, excess_standard_error=0.7)
    fits = refit(1.1 * POLICY.doubted_rest), [refit(0.5, ("a",), 6)]
    found = decide(weigh(few, *fits, 0.0, 40))
    assert (found.verdict, found.probabilities["adequate"]) == ("adequate", POLICY.doubted_noise)
    assert not nominal_suffices(few, fits[0], 40)
    small = refit(0.9 * POLICY.doubted_rest)
    for nominal, floor in ((small, 0.0), (fits[0], 0.5)):
        assert decide(weigh(few, nominal, fits[1], floor, 40)).probabilities["adequate"] > 0.9


def test_a_model_that_misses_one_recording_is_not_surely_adequate() -> None:
    for worst, most in ((1.1 * POLICY.doubted_recording, POLICY.doubted_noise), (0.9 * POLICY.doubted_recording, 1.0)):
        one = data(excess_standard_error=0.4, worst=worst, kind="forces")
        found = decide(weigh(one, refit(0.3), [refit(0.25, ("a",))], 0.0, 40))
        assert found.verdict == "adequate"
        assert found.probabilities["adequate"] == pytest.approx(most, abs=0.05)
        assert nominal_suffices(one, refit(0.05), 40) == (most == 1.0)


@pytest.mark.parametrize(("stated", "most"), [(0.1, POLICY.doubted_noise), (0.5, 1.0), (3.0, 1.0)])
def test_a_stated_noise_far_below_what_differs_between_beats_leaves_a_doubt(stated: float, most: float) -> None:
    one, fits = data(), [SimpleNamespace(stated=ratio) for ratio in (None, SimpleNamespace(ratio=stated))]
    one.__dict__["beat_fits"] = fits
    assert decide(weigh(one, refit(0.1), [], 0.0, 40)).probabilities["adequate"] == pytest.approx(most, abs=0.05)


def test_a_misfit_that_only_an_untried_discretisation_excuses_leaves_a_doubt() -> None:
    """Tracks of a coarse wing with a floor of one noise, of which a fit of a finer one has shown a part, or nothing."""
    left, weighed = refit(0.8), 1.0
    certain = decide(weigh(data(), left, [], weighed, 40))
    assert certain.verdict == "adequate"
    assert certain.probabilities["adequate"] > POLICY.doubted_noise
    doubted = doubted_by_discretisation(certain, data(), left, 0.0, weighed)
    assert doubted.probabilities["adequate"] == POLICY.doubted_noise
    assert sum(doubted.probabilities.values()) == pytest.approx(1.0)
    assert "no finer one was fitted: repeat the diagnosis with refinement" in discretisation_sentence(
        doubted, data(), left, 0.0, weighed
    )
    for nominal, proven in ((left, 0.8), (left, weighed), (refit(0.2), 0.0)):
        assert doubted_by_discretisation(certain, data(), nominal, proven, weighed) is certain
        assert not discretisation_sentence(certain, data(), nominal, proven, weighed)


def test_a_drift_is_not_adequate_even_where_the_mean_beat_fits() -> None:
    fits = refit(0.15), [refit(0.05, ("a",), drift=0.9)]
    assert decide(weigh(data(drift=0.2), *fits, 0.0, 40)).verdict == "adequate", "too small to matter"
    found = decide(weigh(data(drift=0.5), *fits, 0.0, 40))
    assert found.verdict == "unnamed"
    assert found.probabilities["unnamed"] == pytest.approx(1.0)
    assert not nominal_suffices(data(drift=0.5), refit(0.05), 40)


def test_an_effect_whose_size_may_be_zero_is_a_rival_of_one_that_is_hardly_larger(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of few flights alike, an airspeed that is wrong fits no better than a body pitch that is."""
    sizes = {"speed": (0.004, 0.129), "pitch": (-0.036, None)}
    monkeypatch.setattr(
        weigh_hypotheses,
        "gene_values",
        lambda _, one: (SimpleNamespace(value=Interval(0.07, *sizes[one.names[0]]), off=0.0),),
    )
    speed, pitch = refit(0.3, ("speed",), 4), refit(0.35, ("pitch",), 4)
    for one in (speed, pitch):
        one.trials[0].suspect.size_genes = (one.names[0],)  # type: ignore[misc]
    few, nominal = data(2, 0.4), refit(2.1)
    found = decide(weigh(few, nominal, [speed, pitch], 0.0, 40))
    assert (found.verdict, found.alternatives) == ("ambiguous", (("speed",), ("pitch",)))
    assert decide(weigh(few, nominal, [speed], 0.0, 40)).named == ("speed",)
    assert decide(weigh(few, nominal, [pitch], 0.0, 40)).verdict == "unnamed"
    worse = refit(1.2, ("speed",), 4)
    worse.trials[0].suspect.size_genes = ("speed",)  # type: ignore[misc]
    beside = decide(weigh(few, nominal, [worse, pitch], 0.0, 40))
    assert beside.verdict != "named", "an effect that explains little makes no other more probable"


def test_the_probabilities_of_hypotheses_are_those_of_the_verdict() -> None:
    """Of which held-out recordings have taken a fifth."""
    weights = weigh(data(), refit(2.0), [refit(0.3, ("a",)), refit(0.6, ("b",))], 0.0, 40)
    decision = decide(weights)
    doubted = {**decision.probabilities, "named": 0.8 * decision.probabilities["named"]}
    doubted["unnamed"] += 0.2 * decision.probabilities["named"]
    found = _as_decided(weights, replace(decision, probabilities=doubted))
    assert found.probabilities.sum() + found.unknown == pytest.approx(1.0)
    assert found.unknown == pytest.approx(doubted["unnamed"])
    assert found.probabilities[1] / found.probabilities[2] == pytest.approx(
        weights.probabilities[1] / weights.probabilities[2]
    )
    assert _as_decided(weights, decision).probabilities == pytest.approx(weights.probabilities)
