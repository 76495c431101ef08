"""Weighing of hypotheses by their excess above floors, against the nominal model and an unknown law."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.diagnosis.verdict.refits import data, refit
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import Interval
from wingfit.diagnosis.location.differences import _variables
from wingfit.diagnosis.policy import POLICY
from wingfit.diagnosis.search import _unconverged
from wingfit.diagnosis.verdict import weigh_hypotheses
from wingfit.diagnosis.verdict.verdict import decide, explained_fraction
from wingfit.diagnosis.verdict.weigh_hypotheses import (
    HypothesisWeights,
    nominal_refuted,
    nominal_suffices,
    tolerated_excess,
    weigh,
)
from wingfit.records import Condition


def at(table: np.ndarray, k: int, j: int) -> float:
    return float(table[k, j])


def verdict(nominal: float, *others: Refit, floor: float = 0.0) -> tuple[str, tuple[str, ...]]:
    found = decide(weigh(data(), refit(nominal), others, floor, 40))
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    return found.verdict, found.named


def test_an_excess_below_the_noise_is_adequate() -> None:
    assert verdict(0.15, refit(0.1, ("a",)), refit(0.05, ("b",), 3)) == ("adequate", ())


def test_no_effect_explains_beats_that_differ_periodically() -> None:
    """Not one that explains a slow drift beside it either; one that explains a misfit of the mean beat is named."""
    stiffness = refit(0.2, ("stiffness_drift",), drift=0.01)
    for drift in (0.0, 5.0):
        weights = weigh(data(drift=drift, modulation=5.0), refit(1.0), [stiffness], 0.0, 40)
        assert decide(weights).verdict == "unnamed"
    weights = weigh(data(modulation=1.0, mean=25.0), refit(5.0), [refit(0.1, ("hinge",))], 0.0, 40)
    assert decide(weights).named == ("hinge",)


def test_an_effect_that_explains_the_drift_is_possible() -> None:
    """A wrong rate of the strobe shifts the phase of the beat slowly."""
    weights = weigh(data(drift=0.5), refit(0.25), [refit(0.05, ("a",), drift=0.1), refit(0.0, ("b",))], 0.0, 40)
    assert weights.probabilities[0] == 0.0
    assert weights.probabilities[1] > 0.0
    assert weights.probabilities[2] == 0.0


def test_a_hypothesis_that_leaves_the_misfit_as_it_was_is_not_named() -> None:
    """Neither where a drift alone speaks against the nominal model, nor where the mean beat does as well."""
    useless = [refit(2.0, ("a",)), refit(1.99, ("b",))]
    for drift, mean in ((0.0, 4.0), (0.5, 4.0), (0.5, 0.0)):
        found = decide(weigh(data(1, drift=drift, mean=mean), refit(2.0), useless, 0.0, 3))
        assert (found.verdict, found.named, found.alternatives) == ("unnamed", (), ())
        assert found.probabilities["unnamed"] == pytest.approx(1.0)
    beside = decide(weigh(data(drift=0.5, mean=4.0), refit(2.0), [refit(0.3, ("a",)), *useless], 0.0, 40))
    assert (beside.verdict, beside.named) == ("named", ("a",)), "what explains the mean beat, beside the drift"


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        ([(-0.1, 0.2)], "unnamed"),
        ([(None, None)], "unnamed"),
        ([(None, 0.1), (0.0, None)], "unnamed"),
        ([(0.1, 0.2)], "named"),
        ([(-0.2, 0.1), (None, -0.1)], "named"),
    ],
)
def test_an_effect_whose_sizes_may_all_be_zero_is_not_named(
    ends: list[tuple[float | None, float | None]], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = [SimpleNamespace(value=Interval(0.05, *one), off=0.0) for one in ends]
    shape = SimpleNamespace(value=Interval(1.0, 0.5, 2.0), off=None)
    monkeypatch.setattr(weigh_hypotheses, "gene_values", lambda _data, _refit: (*values, shape))
    fitted = refit(0.1, ("a",), 4)
    fitted.trials[0].suspect.size_genes = ("a.size",)  # type: ignore[misc]
    assert decide(weigh(data(2, 0.4), refit(2.1), [fitted], 0.0, 40)).verdict == expected


def test_an_effect_that_explains_nearly_all_is_named() -> None:
    assert verdict(2.0, refit(0.3, ("a",)), refit(1.5, ("b",))) == ("named", ("a",))


def test_further_effects_that_an_unknown_law_may_replace_are_not_named() -> None:
    one, three = refit(1.6, ("a",)), refit(0.6, ("a", "b", "c"), 2)
    assert verdict(5.0, one, three) == ("named", ("a",)), "a law outside the library explains as much for less"
    clearly = refit(0.0, ("a", "b"))
    assert verdict(5.0, refit(2.5, ("a",)), clearly) == ("named", ("a", "b"))
    assert verdict(5.0, refit(4.0, ("a",)), three)[0] == "unnamed", "three effects imitate almost anything"
    assert verdict(5.0, refit(1.6, ("d",)), refit(0.3, ("a", "b"))) == ("named", ("a", "b")), "of its own effects only"


def test_several_effects_must_leave_less_than_one() -> None:
    """Together they imitate more of a law outside the library; what noise explains is no imitation."""
    left = 5.0 * 0.26
    assert verdict(5.0, refit(left, ("a",), 3))[0] == "named"
    assert verdict(5.0, refit(4.5, ("a",)), refit(left, ("a", "b")))[0] == "unnamed"
    assert verdict(5.0, refit(4.5, ("a",)), refit(5.0 * 0.1, ("a", "b")))[0] == "named"
    before = replace(POLICY, several_left=POLICY.unknown_residual)
    weights = weigh(
        cast("WhitenedData", SimpleNamespace(**{**vars(data()), "policy": before})),
        refit(5.0),
        [refit(4.5, ("a",)), refit(left, ("a", "b"))],
        0.0,
        40,
    )
    assert decide(weights).verdict == "named", "that alone makes the difference"
    assert verdict(1.5, refit(1.4, ("a",)), refit(0.25, ("a", "b")))[0] == "named", "within the noise"


def test_an_effect_that_leaves_a_rest_is_never_certain() -> None:
    """It may imitate a law outside the library; what noise and the form of a law explain casts no doubt."""
    for left, least, most in ((5.0 * 0.3, 0.7, 1.0 - POLICY.partial_doubt), (5.0 * 0.1, 0.95, 1.0)):
        found = weigh(data(), refit(5.0), [refit(left, ("a",))], 0.0, 40)
        assert least < found.probabilities[1] <= most
        assert found.unknown + found.probabilities.sum() == pytest.approx(1.0)
        within = weigh(data(excess_standard_error=1.0), refit(5.0), [refit(left, ("a",))], 0.0, 40)
        assert within.probabilities[1] > 0.9, "the error of the noise explains it"


def test_effects_that_do_not_explain_a_large_drift_are_never_certain() -> None:
    """A slow change of the beat moves the mean beat too; a small one, or one that they explain, casts no doubt."""
    small = 5.0 * POLICY.drift_rivals / 1.1
    for change, left, most in ((2.0, 1.0, 1.0 - POLICY.partial_doubt), (2.0, 0.1, 1.0), (small, 1.0, 1.0)):
        named = refit(0.2, ("a",), drift=left)
        found = weigh(data(drift=change, mean=25.0), refit(5.0), [named], 0.0, 40)
        assert most - 0.05 < found.probabilities[1] <= most
        assert found.unknown + found.probabilities.sum() == pytest.approx(1.0)


def test_sharing_with_parts_beside_an_unknown_law_loses_no_probability() -> None:
    names = ((), ("a",), ("b",), ("a", "b"), ("a", "b", "c"))
    each = [refit(1.0, one) for one in names]
    rng = np.random.default_rng(3)
    for _ in range(50):
        weight, beside = rng.normal(0.0, 3.0, (2, len(names)))
        odds = beside[None, :] - weight[:, None]
        found = weigh_hypotheses._with_unknown_rest(each, weight, partial(at, odds))
        assert np.logaddexp.reduce(found) == pytest.approx(np.logaddexp.reduce(weight))
        assert found[0] == weight[0]
        assert found[-1] <= weight[-1]
        assert found[1] >= weight[1]
    ordered = np.array([4, 2, 0, 3, 1])
    moved = odds[np.ix_(ordered, ordered)]
    other = weigh_hypotheses._with_unknown_rest([each[k] for k in ordered], weight[ordered], partial(at, moved))
    np.testing.assert_allclose(other, found[ordered])
    several = [refit(1.82, ("a",)), refit(1.62, ("a", "b")), refit(1.12, ("a", "b", "c"))]
    weights = weigh(data(), refit(4.07), several, 0.0, 40)
    assert weights.probabilities[1] > 10.0 * weights.probabilities[2:].sum()
    assert decide(weights).verdict == "unnamed", "the effect alone leaves a fifth, and may imitate the unknown law"


def test_a_small_second_effect_that_leaves_nothing_is_named_beside_a_large_first() -> None:
    """What a second effect may leave is relative to what the first leaves, not to the misfit of the nominal model."""
    first = refit(50.0 * 0.23, ("a",))
    assert verdict(50.0, first, refit(0.05, ("a", "b"), 4)) == ("named", ("a", "b"))
    half = refit(50.0 * 0.23 * 0.4, ("a", "b"), 4)
    assert verdict(50.0, first, half)[1] == ("a",), "a law outside the library may explain as much"


def test_a_measurement_fault_has_its_own_verdict() -> None:
    found = verdict(2.0, refit(0.3, ("a",), family="measurement"), refit(1.5, ("b",)))
    assert found == ("measurement fault", ("a",))


def test_equally_good_effects_are_ambiguous() -> None:
    assert verdict(2.0, refit(0.30, ("a",)), refit(0.31, ("b",)))[0] == "ambiguous"


def test_the_effect_common_to_all_possible_hypotheses_is_named() -> None:
    """A second effect is uncertain but the first is not; where the first alone is not possible, none is named."""
    both = [refit(0.46, ("a",)), refit(0.30, ("a", "b"), 1)]
    found = decide(weigh(data(), refit(2.0), both, 0.0, 40))
    assert (found.verdict, found.named) == ("named", ("a",))
    assert set(found.alternatives) == {("a",), ("a", "b")}
    assert found.probabilities["named"] > 0.8
    apart = [refit(0.30, ("a", "c"), 1), refit(0.30, ("a", "b"), 1)]
    assert decide(weigh(data(), refit(2.0), apart, 0.0, 40)).verdict == "ambiguous"


def test_alternatives_are_listed_only_for_a_verdict_on_effects() -> None:
    open_ = decide(weigh(data(), refit(2.0), [refit(0.30, ("a",)), refit(0.31, ("b",))], 0.0, 40))
    assert set(open_.alternatives) == {("a",), ("b",)}
    assert decide(weigh(data(), refit(3.0), [refit(2.2, ("a",)), refit(2.2, ("b",))], 0.0, 40)).alternatives == ()


@pytest.mark.parametrize(("genes", "verdict"), [(1, "ambiguous"), (2, "ambiguous"), (3, "named")])
def test_the_cost_of_one_gene_decides_nothing(genes: int, verdict: str) -> None:
    """Of two effects that fit alike, one with a gene more is no less likely the cause; with two more it is."""
    rivals = [refit(0.30, ("a",)), refit(0.30, ("b",), genes)]
    assert decide(weigh(data(), refit(2.0), rivals, 0.0, 40)).verdict == verdict


@pytest.mark.parametrize(
    ("nominal", "effect", "unknown", "expected"),
    [(0.48, 0.47, 0.05, "named"), (0.48, 0.05, 0.47, "unnamed"), (0.52, 0.43, 0.05, "adequate")],
)
def test_missing_physics_is_decided_before_its_name(
    nominal: float, effect: float, unknown: float, expected: str
) -> None:
    refits, shares = (refit(1.0), refit(0.5, ("a",))), np.array([nominal, effect])
    assert decide(HypothesisWeights(refits, np.log(shares), shares, unknown, np.array([1.0, 0.25]))).verdict == expected


def test_an_excess_beyond_noise_is_searched_even_with_few_samples() -> None:
    one = data(1, 0.01)
    assert nominal_refuted(one, refit(0.45).excess, 0.0)
    assert not nominal_suffices(one, refit(0.45), 40)
    assert nominal_suffices(data(1, 0.1), refit(0.45), 40)


def test_the_search_starts_before_a_perfect_effect_would_be_worth_its_genes() -> None:
    """Where the search is skipped, even an effect without residual would be less probable than the nominal model."""
    sufficient = [left for left in np.linspace(0.0, 2.0, 401) if nominal_suffices(data(), refit(left), 40)]
    evidence = weigh(data(), refit(max(sufficient)), [refit(0.0, ("a",))], 0.0, 40).evidence
    assert len(sufficient) > 10
    assert evidence[1] < -1.0


@pytest.mark.parametrize(
    ("left", "before", "part"),
    [(1.0, 4.0, 0.75), (-0.1, 4.0, 1.0), (9.0, 4.0, -1.0), (1.0, 0.0, 0.0), (0.1, -0.1, 0.0)],
)
def test_theexplained_fraction_of_an_excess(left: float, before: float, part: float) -> None:
    assert explained_fraction(left, before) == part


def test_a_vacuum_has_no_exponent_of_density() -> None:
    def named(*pressures: float) -> list[str]:
        return [name for name, *_ in _variables([Condition(3.0, 0.0, p, 293.15) for p in pressures])]

    assert named(0.0, 1e3, 1e5) == ["flap frequency"]
    assert named(1e3, 1e5) == ["flap frequency", "air density"]


def test_an_effect_that_explains_little_is_not_named() -> None:
    assert verdict(3.0, refit(2.2, ("a",)), refit(2.5, ("b",))) == ("unnamed", ())


@pytest.mark.parametrize(("left", "added"), [(1.5, ("a",)), (2.9, ())])
def test_the_best_effect_is_added_only_if_worth_its_genes(left: float, added: tuple[str, ...]) -> None:
    found = decide(weigh(data(), refit(3.0), [refit(left, ("a",), 2), refit(2.95, ("b",), 2)], 0.0, 40))
    assert (found.verdict, found.best.names) == ("unnamed", added)


@pytest.mark.parametrize(("left", "ended", "expected"), [(0.5, False, "b"), (0.5, True, None), (2.9, False, None)])
def test_an_unconverged_rival_is_continued_if_it_may_overtake(left: float, ended: bool, expected: str | None) -> None:
    def fitted(one: Refit, converged: bool) -> Refit:
        return replace(
            one, fit=cast("Any", SimpleNamespace(converged=converged, jacobian_measured=True, coefficients=0.0))
        )

    others = [fitted(refit(0.3, ("a",)), converged=True), fitted(refit(left, ("b",), 2), converged=ended)]
    found = _unconverged(weigh(data(), refit(3.0), others, 0.0, 40))
    assert (found and found.names) == (expected and (expected,))


def test_a_second_effect_must_be_worth_its_genes() -> None:
    assert verdict(3.0, refit(0.4, ("a",)), refit(0.35, ("a", "b"), 1)) == ("named", ("a",))
    found = verdict(3.0, refit(1.4, ("a",)), refit(0.2, ("a", "b"), 1))
    assert found[0] == "named"
    assert set(found[1]) == {"a", "b"}


@pytest.mark.parametrize(("excess_standard_error", "expected"), [(0.4, "named"), (1.2, "adequate")])
def test_an_excess_far_beyond_noise_counts_even_with_few_recordings(
    excess_standard_error: float, expected: str
) -> None:
    """Two recordings give too few samples for a law of four genes; yet the nominal model is refuted."""
    found = decide(weigh(data(2, excess_standard_error), refit(2.1), [refit(0.1, ("a",), 4)], 0.0, 40))
    assert found.verdict == expected


def test_an_effect_no_more_probable_than_an_unknown_law_is_not_named() -> None:
    shares = []
    for left in np.linspace(0.5, 0.9, 401):
        every = weigh(data(), refit(2.0), [refit(left, ("a",))], 0.0, 40)
        share = every.probabilities[1] / (every.probabilities[1] + every.unknown)
        assert decide(every).verdict == ("named" if share >= POLICY.listed else "unnamed")
        shares.append(share)
    assert min(shares) < 0.5 < POLICY.listed < max(shares)
    assert any(0.5 < share < POLICY.listed for share in shares)


def test_of_two_equal_fits_the_better_cross_validated_is_more_probable() -> None:
    """A cross-validation counts less than a fit, because it is linearised."""
    alike, better = refit(0.6, ("a",)), refit(0.6, ("b",), predicted=0.3)
    fitted = refit(0.3, ("c",), predicted=0.6)
    _, *shares = weigh(data(), refit(2.0), [alike, better, fitted], 0.0, 40).probabilities
    assert 2.0 * shares[0] < shares[1] < shares[2] / 2.0


def test_a_missing_cross_validation_and_a_negative_excess() -> None:
    """A single recording has no cross-validation; noise may make an excess negative, which counts as zero."""
    others = [refit(0.0, ("a",)), refit(0.5, ("b",))]
    single = [others[0], replace(others[1], predicted=None)]
    below = [replace(others[0], excess=-0.2, predicted=-0.3), others[1]]
    expected, *found = (weigh(data(), refit(2.0), r, 0.0, 40).probabilities for r in (others, single, below))
    np.testing.assert_allclose(found, [expected] * 2)
    assert tolerated_excess(data(), -0.2, 0.0) == tolerated_excess(data(), 0.0, 0.0)


def test_a_single_suspect_has_the_prior_of_one_of_two() -> None:
    one, two, many = (weigh(data(), refit(2.0), [refit(0.9, ("a",))], 0.0, n).probabilities[1] for n in (1, 2, 40))
    assert one == two > many


@pytest.mark.parametrize("unit", [1e-3, 1e3])
@pytest.mark.parametrize(("nominal", "excess_standard_error"), [(0.45, 0.01), (0.45, 0.1), (2.0, 0.1)])
def test_no_verdict_depends_on_the_unit_of_length(unit: float, nominal: float, excess_standard_error: float) -> None:
    def outcome(unit: float) -> tuple[list[float], bool, bool]:
        scaled = cast(
            "WhitenedData",
            SimpleNamespace(
                noise=unit,
                effective_samples=36.0,
                excess_standard_error=excess_standard_error * unit**2,
                beat_fits=(),
                excess_by_chance=lambda _: 0.0,
                accepted=0.0,
                gene_cost=POLICY.gene_cost,
                kind="tracks",
                policy=POLICY,
                drift=0.5,
                noise_of_recordings=np.full(6, unit),
                excess_by_recording=lambda _: np.full(6, 0.5 * unit**2),
                uncertainty_of_beats=np.zeros(6),
                tolerance=POLICY.tolerance * unit,
                change_of_beat=lambda power: power * unit**2,
                mean_beat_excess=lambda _: 4.0 * unit**2,
            ),
        )
        before, *others = (
            refit(unit * left, (name,), predicted=2.0 * unit * left, drift=drift)
            for left, name, drift in ((nominal, "", 1.0), (0.3, "a", 0.1), (0.2, "b", 0.9))
        )
        found = weigh(scaled, before, others, 0.2 * unit, 40)
        shares = [*found.probabilities, found.unknown, *found.excess]
        return shares, nominal_refuted(scaled, before.excess, 0.2 * unit), nominal_suffices(scaled, before, 40)

    shares, *flags = outcome(unit)
    expected, *others = outcome(1.0)
    np.testing.assert_allclose(shares, expected)
    assert flags == others


def test_an_imitation_of_another_cause_is_not_named() -> None:
    """An effect of one gene that leaves a sixth of the misfit: smooth omissions are imitated as well as that."""
    assert verdict(4.0, refit(4.0 * 0.10**0.5, ("a",))) == ("named", ("a",))
    assert verdict(4.0, refit(4.0 * 0.17**0.5, ("a",)))[0] == "unnamed"
    series = cast("Any", data())
    series.kind = "series"
    imitated = refit(4.0), refit(4.0 * 0.17**0.5, ("a",))
    assert not weigh_hypotheses._imitation(series, imitated, 0.0, 0.0).any(), "with a beat only"


def test_more_genes_must_be_worth_their_cost() -> None:
    assert verdict(2.0, refit(0.32, ("a",), 1), refit(0.30, ("b",), 8)) == ("named", ("a",))


def test_an_excess_below_the_discretisation_error_is_adequate() -> None:
    assert verdict(0.9, refit(0.5, ("a",), 2), floor=1.0)[0] == "adequate"
    assert verdict(0.9, refit(0.2, ("a",), 2))[0] == "named"


def test_probabilities_change_smoothly() -> None:
    """As an effect explains more, its probability rises from near zero to near one without a jump."""
    found = [
        weigh(data(), refit(2.0), [refit(left, ("a",))], 0.0, 40).probabilities[1]
        for left in np.linspace(1.6, 0.1, 400)
    ]
    assert found[0] < 0.05
    assert found[-1] > 0.95
    assert np.all(np.diff(found) > -1e-12)
    assert np.max(np.diff(found)) < 0.25
