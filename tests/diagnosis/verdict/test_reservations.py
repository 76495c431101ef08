"""What held-out series and a misfit that remains do to a verdict."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from wingfit.diagnosis.finding import NAMING, VERDICTS, Interval, Proof, Verdict
from wingfit.diagnosis.policy import POLICY
from wingfit.diagnosis.verdict.reservations import (
    accepted_error_sentence,
    accepted_sentence,
    candidate_sentence,
    doubted_by_held_out,
    held_out_sentence,
    judged_by_accepted_error,
    missed_sentence,
    partly,
    remaining_sentence,
)
from wingfit.diagnosis.verdict.verdict import Decision
from wingfit.records import Channel, Series

FIT = SimpleNamespace(coefficients=np.zeros(1))


def decision(verdict: Verdict) -> Decision:
    probabilities: dict[str, float] = {**dict.fromkeys(map(str, VERDICTS), 0.0), verdict: 0.97, "unnamed": 0.03}
    names = ("drag",) if verdict in NAMING else ()
    return Decision(
        verdict, probabilities, names, (), cast("Any", SimpleNamespace(names=("drag",), excess=25.0, fit=FIT))
    )


def proof(before: float, after: float, *, improved: bool) -> Proof:
    def around(value: float) -> Interval:
        return Interval(value, 0.9 * value, 1.1 * value)

    return Proof(around(before), around(after), 1.0, improved, "")


def data(kind: str = "series", accepted: float = 0.0) -> Any:
    times, channel = np.arange(4.0), Channel("height", "m", accepted_error=0.5)
    return SimpleNamespace(
        kind=kind,
        unit="noise",
        noise=1.0,
        accepted=accepted,
        tolerance=0.1,
        policy=POLICY,
        excess_standard_error=0.05,
        excess_by_chance=lambda _: 0.0,
        noise_of_recordings=np.ones(1),
        excess_by_recording=lambda _: np.zeros(1),
        drift=0.0,
        recordings=(Series("one", times, (channel,), times[:, None]),),
    )


@pytest.mark.parametrize("verdict", ["named", "partly named", "ambiguous", "measurement fault"])
def test_effects_that_predict_no_better_are_not_named(verdict: Verdict) -> None:
    before, useless = decision(verdict), proof(2.1, 2.1, improved=False)
    after = doubted_by_held_out(before, useless, data())
    assert (after.verdict, after.named) == ("unnamed", ())
    assert after.probabilities["unnamed"] == pytest.approx(1.0)
    assert "It is not named, because" in held_out_sentence(before, useless, data())


@pytest.mark.parametrize(("before", "after", "improved"), [(2.1, 1.0, True), (2.1, 1.5, False), (1.02, 1.02, False)])
def test_effects_that_predict_better_or_where_nothing_was_missed_stay(
    before: float, after: float, improved: bool
) -> None:
    found, proved = decision("named"), proof(before, after, improved=improved)
    assert doubted_by_held_out(found, proved, data()) == found
    assert held_out_sentence(found, proved, data()) == ""


def test_a_model_that_does_not_predict_is_adequate_with_little_certainty() -> None:
    before, wrong = decision("adequate"), proof(4.6, 4.6, improved=False)
    after = doubted_by_held_out(before, wrong, data())
    assert after.verdict == "adequate"
    assert after.probabilities["adequate"] == POLICY.doubted_noise
    assert sum(after.probabilities.values()) == pytest.approx(1.0)
    assert "does not predict the held-out recordings: their misfit is 4.6 times" in held_out_sentence(
        before, wrong, data()
    )
    assert doubted_by_held_out(before, proof(1.1, 1.1, improved=False), data()) == before


def test_effects_that_do_not_predict_are_named_with_limited_certainty() -> None:
    """As an error of one axis of a balance, with the nearest effect of the library."""
    before, far = decision("named"), proof(6.0, 3.6, improved=True)
    after = doubted_by_held_out(before, far, data("forces"))
    assert (after.verdict, after.named) == ("named", ("drag",))
    assert after.probabilities["named"] == pytest.approx(1.0 - POLICY.partial_doubt)
    assert "But held-out recordings are still missed" in held_out_sentence(before, far, data("forces"))
    assert doubted_by_held_out(before, far, data("series")) == before, "no trials show how often it is wrong"
    near = proof(6.0, 1.9, improved=True)
    assert doubted_by_held_out(before, near, data("forces")) == before
    assert held_out_sentence(before, near, data("forces")) == ""


def test_alternatives_that_do_not_predict_are_not_named() -> None:
    """As a swept wing, which in some ways looks like a delay of the clock or of a filter."""
    before = replace(decision("ambiguous"), named=("a", "b"), alternatives=(("a",), ("b",)))
    far, claimed = proof(15.0, 7.5, improved=True), before.probabilities["ambiguous"]
    after = doubted_by_held_out(before, far, data("forces"), none_predicts=True)
    assert (after.verdict, after.named, after.alternatives) == ("unnamed", (), ())
    assert after.probabilities["ambiguous"] == pytest.approx(POLICY.partial_doubt * claimed)
    assert sum(after.probabilities.values()) == pytest.approx(1.0)
    words = held_out_sentence(before, far, data("forces"), none_predicts=True)
    assert words.endswith("with the most probable one their misfit is 7.5 times the floor.")
    doubted = doubted_by_held_out(before, far, data("forces"))
    assert (doubted.verdict, doubted.named) == ("ambiguous", ("a", "b")), "another one predicts"


def test_a_recording_that_an_adequate_model_misses_is_stated() -> None:
    """Mains hum at a harmonic of one recording's beat is noise in the others."""
    hum = data("forces")
    hum.recordings = (SimpleNamespace(name="quiet"), SimpleNamespace(name="hum"))
    hum.noise_of_recordings, hum.excess_by_recording = np.array([0.5, 0.5]), lambda _: np.array([0.0, 4.0])
    found = decision("adequate")
    words = missed_sentence(hum, found, found.best, 0.0)
    assert words == " The model misses hum by 4 times its noise: something may act there that the others do not show."
    assert "no more than errors" not in remaining_sentence(hum, found, replace_excess(found, 0.2).best, 1.0, 0.0)
    hum.excess_by_recording = lambda _: np.array([4.0, 4.0])
    assert "the others" not in missed_sentence(hum, found, found.best, 0.0)
    assert missed_sentence(hum, decision("named"), found.best, 0.0) == ""
    assert missed_sentence(hum, found, found.best, 2.0) == "", "the discretisation explains it"


def test_a_model_that_held_out_recordings_refute_is_not_adequate() -> None:
    before, wrong = decision("adequate"), proof(3.0, 3.0, improved=False)
    after = doubted_by_held_out(before, wrong, data(), refuted=True)
    assert (after.verdict, after.probabilities["adequate"]) == ("unnamed", 0.0)
    assert sum(after.probabilities.values()) == pytest.approx(1.0)
    assert "but the held-out ones do: their misfit is 3 times" in held_out_sentence(before, wrong, data(), refuted=True)
    assert doubted_by_held_out(decision("named"), proof(3.0, 1.0, improved=True), data(), refuted=True) == decision(
        "named"
    )


@pytest.mark.parametrize("kind", ["tracks", "forces"])
def test_held_out_recordings_with_a_beat_count_as_well(kind: str) -> None:
    """Such as one with exchanged axes, of which the fitted ones know nothing."""
    wrong = proof(88.0, 88.0, improved=False)
    named, adequate = (doubted_by_held_out(decision(one), wrong, data(kind)) for one in ("named", "adequate"))
    assert (named.verdict, named.named) == ("unnamed", ())
    assert adequate.probabilities["adequate"] == POLICY.doubted_noise
    assert doubted_by_held_out(decision("unnamed"), wrong, data(kind)) == decision("unnamed")


def test_without_held_out_recordings_nothing_changes() -> None:
    assert doubted_by_held_out(decision("named"), None, data()) == decision("named")


def test_a_misfit_that_remains_is_stated() -> None:
    found = decision("named")
    assert "A misfit of 5 times the noise beyond the noise remains" in remaining_sentence(
        data(), found, found.best, 0.0, 0.0
    )
    assert "A misfit of 0.447 times the noise" in remaining_sentence(
        data(), decision("adequate"), replace_excess(found, 0.2).best, 1.0, 1.0
    )
    assert remaining_sentence(data(accepted=1.0), decision("adequate"), found.best, 0.0, 0.0) == ""
    exact = replace_excess(found, 0.01)
    assert remaining_sentence(data(), exact, exact.best, 0.0, 0.0) == ""
    small = replace_excess(found, 0.2)
    assert "remains, no more than errors of the noise and of the" in remaining_sentence(
        data(), small, small.best, 1.0, 1.0
    )


@pytest.mark.parametrize(("verdict", "also"), [("adequate", ""), ("named", " too")])
def test_a_misfit_that_noise_rarely_makes_is_not_called_noise(verdict: Verdict, also: str) -> None:
    """The noise of few forces is known badly: with this error, noise could make a misfit of its own size."""
    few = data("forces")
    few.excess_standard_error = 0.7
    large, small = (replace_excess(decision(verdict), (share * POLICY.doubted_rest) ** 2) for share in (1.1, 0.9))
    words = remaining_sentence(few, large, large.best, 0.0, 0.0)
    assert f"more than noise usually makes: something may be missing{also}" in words
    assert "no more than errors of the noise" in remaining_sentence(few, small, small.best, 0.0, 0.0)
    assert "no more than errors of the noise" in remaining_sentence(few, large, large.best, 0.5, 0.5), "discretisation"


@pytest.mark.parametrize(
    ("left", "verdict", "said"),
    [
        (0.1, "adequate", " Most of it, 67 %, would go with play: too little evidence to add to the model."),
        (0.2, "adequate", ""),
        (0.1, "unnamed", ""),
    ],
)
def test_what_would_remove_most_of_what_an_adequate_model_leaves_is_stated(
    left: float, verdict: Verdict, said: str
) -> None:
    refits = [SimpleNamespace(names=names, excess=excess, fit=FIT) for names, excess in (((), 0.3), (("play",), left))]
    weights: Any = SimpleNamespace(refits=refits, evidence=np.array([0.0, -1.0]))
    suspects: Any = {"play": SimpleNamespace(title="Play")}
    assert candidate_sentence(data("tracks"), decision(verdict), weights, suspects) == said
    refits[0].excess = 0.01
    assert candidate_sentence(data("tracks"), decision(verdict), weights, suspects) == ""


def replace_excess(found: Decision, excess: float) -> Decision:
    best = cast("Any", SimpleNamespace(names=found.best.names, excess=excess, fit=FIT))
    return Decision(found.verdict, found.probabilities, found.named, found.alternatives, best)


def either(*excesses: float, first: float = 0.5) -> tuple[Decision, Any]:
    """An ambiguous verdict between effects that leave ``excesses``, the ``first`` probability that of the first."""
    names = [f"effect {k}" for k in range(len(excesses))]
    refits: list[Any] = [SimpleNamespace(names=(), excess=400.0)]
    refits += [SimpleNamespace(names=(name,), excess=excess) for name, excess in zip(names, excesses, strict=True)]
    probabilities = np.array([0.01, first, *[(0.99 - first) / (len(excesses) - 1)] * (len(excesses) - 1)])
    weights = SimpleNamespace(refits=tuple(refits), probabilities=probabilities)
    return replace(decision("ambiguous"), alternatives=tuple((name,) for name in names)), weights


def test_alternatives_that_leave_more_than_the_accepted_error_explain_nothing() -> None:
    found, weights = either(36.0, 49.0)
    after = judged_by_accepted_error(found, data(accepted=5.0), weights, 0.0)
    assert (after.verdict, after.named, after.alternatives) == ("unnamed", (), ())
    assert after.probabilities["unnamed"] == pytest.approx(1.0)
    assert "leave more than the accepted error" in accepted_error_sentence(found, after)
    for unchanged in (data(accepted=0.0), data("tracks", accepted=5.0)):  # a law that is nearly right leaves a misfit
        assert judged_by_accepted_error(found, unchanged, weights, 0.0) == found
    assert judged_by_accepted_error(decision("named"), data(accepted=5.0), weights, 0.0) == decision("named")


@pytest.mark.parametrize("first", [0.1, 0.45, 0.55, 0.9])
def test_only_the_probability_of_what_explains_too_little_is_lost(first: float) -> None:
    """``first``: probability of an effect that explains enough, beside one that does not; 0.97 of all is for names."""
    found, weights = either(16.0, 49.0, first=first)
    after = judged_by_accepted_error(found, data(accepted=5.0), weights, 0.0)
    left = 0.97 * first / 0.99
    assert after.probabilities["ambiguous"] == pytest.approx(left)
    assert after.probabilities["unnamed"] == pytest.approx(1.0 - left)
    assert after.verdict == ("ambiguous" if first > 0.5 else "unnamed")
    assert (accepted_error_sentence(found, after) == "") == (first > 0.5)


@pytest.mark.parametrize(
    ("accepted", "excess", "stated"),
    [(10.0, 25.0, True), (10.0, 0.0, False), (0.0, 25.0, False), (1e-3, 0.2, False), (4.9, 25.0, False)],
)
def test_a_model_that_is_adequate_by_the_accepted_error_alone_says_so(
    accepted: float, excess: float, *, stated: bool
) -> None:
    found = replace_excess(decision("adequate"), excess)
    words = accepted_sentence(data(accepted=accepted), found, found.best, 0.0)
    assert words == (" What exceeds the noise is within the accepted error: 0.5 m in height." if stated else "")
    assert accepted_sentence(data(accepted=accepted), decision("unnamed"), found.best, 0.0) == ""


@pytest.mark.parametrize("verdict", VERDICTS)
def test_effects_that_leave_more_than_noise_and_form_are_a_part(verdict: Verdict) -> None:
    before = decision(verdict)  # leaves an excess of 25
    nominal = cast("Any", SimpleNamespace(excess=400.0, fit=FIT))
    after = partly(before, data("forces"), nominal, 0.0)
    if verdict not in NAMING:
        assert after is before
        return
    assert (after.verdict, after.named) == ("partly named", ("drag",))
    assert after.probabilities["partly named"] == pytest.approx(1.0 - POLICY.partial_doubt), "although each leaves less"
    assert sum(after.probabilities.values()) == pytest.approx(1.0)
    other_form = cast("Any", SimpleNamespace(excess=25.0 / POLICY.form**2, fit=FIT))
    assert partly(before, data("forces"), other_form, 0.0).verdict == verdict, "laws of two forms differ by as much"
    assert partly(before, data("forces"), nominal, 5.0).verdict == verdict, "the discretisation explains it"
