"""Start points that compete at the end of a search: indistinguishable effects and look-alikes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import GENES, SUSPECTS, PendulumRig, recorded
from wingfit.diagnosis import DiagnosisSpec, search
from wingfit.diagnosis.combinations import smaller_refits
from wingfit.diagnosis.diagnose import check, diagnose
from wingfit.diagnosis.evidence.competing_fits import StartPoint
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.screen import Trial
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.policy import POLICY
from wingfit.diagnosis.search import _indistinguishable, _look_alikes, _towards, run_search
from wingfit.diagnosis.search_state import SearchState
from wingfit.records import load_dataset, wing_or_vehicle
from wingfit.workers.in_process import InProcessEvaluator

ROOT = Path(__file__).parents[2]


def trial(name: str, *, confused_with: tuple[str, ...] = ()) -> Trial:
    """A trial of the pendulum's suspect ``name`` at its typical genes."""
    suspect = replace(next(one for one in SUSPECTS if one.name == name), confused_with=confused_with)
    count = len(suspect.genes)
    return Trial(suspect, np.full((1, count), 0.4), np.zeros((1, 1)), 0.0, np.ones(1), count, 0.0)


def refit(*trials: Trial, excess: float = 1.0, predicted: float | None = None) -> Any:
    """A refit with ``excess``, fitted and ``predicted``, every gene at 0.8 of its box."""
    free = tuple(gene.name for one in trials for gene in one.suspect.genes)
    fit = SimpleNamespace(problem=SimpleNamespace(free=free), unit=np.full(len(free), 0.8), converged=True)
    names = tuple(one.suspect.name for one in trials)
    return SimpleNamespace(trials=trials, names=names, excess=excess, predicted=predicted, fit=fit)


def known(evidence: Sequence[float], *refits: Any) -> Any:
    """Weights of ``refits`` and a nominal model, with the log evidence of each."""
    return SimpleNamespace(refits=(refit(), *refits), evidence=np.array([0.0, *evidence]), policy=POLICY)


def state(*tried: Trial) -> Any:
    """A search state with trials of ``tried`` and noise of 1."""
    data = SimpleNamespace(
        noise=1.0,
        excess_standard_error=0.0,
        excess_by_chance=lambda _: 0.0,
        policy=POLICY,
        drift=0.0,
        accepted=0.0,
        gene_cost=POLICY.gene_cost,
        kind="tracks",
    )
    return SimpleNamespace(data=data, refits=[], trials=[[one] for one in tried])


def names(start_points: Sequence[StartPoint]) -> list[tuple[str, ...]]:
    return [tuple(one.suspect.name for one in entry.trials) for entry in start_points]


def test_all_is_tried_with_the_coarse_discretisation_before_a_finer_one_takes_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A finer one may absorb a mass, and no score test shows what the genes of the coarse one have absorbed."""
    done: list[tuple[str, str]] = []

    def step(name: str) -> Any:
        def run(searched: SearchState) -> Iterator[Any]:
            done.append((cast("Any", searched.subject), name))
            searched.refits.append(refit(trial("point_mass"), excess=0.1 if name == "combinations" else 0.9))
            yield 0.5, name

        return run

    def fitted(*_: Any, refine: bool) -> Any:
        return SimpleNamespace(subject="fine" if refine else "coarse", refit=refit(excess=0.7))

    monkeypatch.setattr(search, "choose_discretisation", fitted)
    monkeypatch.setattr(search, "score_tests", lambda *_: [])
    monkeypatch.setattr(search, "_suffices", lambda *_: False)
    monkeypatch.setattr(search, "_continue_best", lambda _: False)
    monkeypatch.setattr(SearchState, "beats_unknown_law", False)
    monkeypatch.setattr(search, "_single_refits", step("singles"))
    monkeypatch.setattr(search, "_refits_from_estimates", step("estimates"))
    monkeypatch.setattr(search, "combined_refits", step("combinations"))
    searched = SearchState(FitContext(*cast("Any", ("coarse", SimpleNamespace(policy=POLICY), None))))
    assert list(search._search_coarse_first(searched, cast("Any", None), []))
    assert done == [("coarse", "singles"), ("coarse", "estimates"), ("coarse", "combinations")]


def test_a_series_is_refitted_without_each_of_three_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """An effect that was added first, because it imitates two others, may be needed no longer with both of them."""
    mass, cubic, gain = (trial(name) for name in ("point_mass", "cubic", "gain"))
    three, two = refit(mass, cubic, gain, excess=1.0), refit(mass, cubic, excess=5.0)
    added: list[Any] = []
    searched = state()
    searched.data.kind, searched.refits, searched.by_excess = "series", [two, three], [three, two]
    searched.context, searched.add = None, added.append
    searched.fitted_nominal = SimpleNamespace(refit=refit())

    def without(_: object, best: Any, part: Trial) -> Any:
        return refit(*(one for one in best.trials if one is not part))

    monkeypatch.setattr("wingfit.diagnosis.combinations.refit_without", without)
    assert list(smaller_refits(searched)) == ["refit with cubic and gain", "refit with gain and point_mass"]
    assert [set(one.names) for one in added] == [{"cubic", "gain"}, {"point_mass", "gain"}]
    searched.by_excess = [two, three]
    assert list(smaller_refits(searched)) == []
    searched.data.kind, searched.by_excess = "tracks", [three, two]
    assert list(smaller_refits(searched)) == []
    searched.data.kind = "forces"
    assert len(list(smaller_refits(searched))) == 3, "of forces, what was fitted from other genes is fitted again"


def test_indistinguishable_single_effects_compete() -> None:
    mass, cubic, gain = refit(trial("point_mass")), refit(trial("cubic")), refit(trial("gain"))
    close = known([40.0, 40.0 - 0.9 * POLICY.overtake, 40.0 - 1.1 * POLICY.overtake], mass, cubic, gain)
    assert names(_indistinguishable(close)) == [
        ("point_mass",),
        ("point_mass",),
        ("cubic",),
    ]  # a suspect with a location has two start points
    assert _indistinguishable(known([40.0, 0.9 * POLICY.overtake], mass, cubic)) == []
    assert _indistinguishable(known([4.0, -0.1], mass, cubic)) == [], "an effect without evidence is no rival"
    assert _indistinguishable(known([])) == []


def test_combinations_do_not_compete() -> None:
    both = refit(trial("cubic"), trial("gain"))
    assert _indistinguishable(known([40.0, 39.0], refit(trial("cubic")), both)) == []


def test_each_effect_is_replaced_by_look_alikes() -> None:
    cubic, gain, delay = (
        trial("cubic", confused_with=("gain", "point_mass", "unheard_of")),
        trial("gain"),
        trial("delay"),
    )
    found = _look_alikes(state(cubic, gain, delay), cast("Any", refit(cubic, delay)))
    assert names(found) == [("delay", "gain")], "the mass has no trial"
    np.testing.assert_allclose(found[0].unit[0], 0.8)  # the delay keeps its fitted gene
    assert names(_look_alikes(state(cubic, gain), cast("Any", refit(cubic, gain)))) == [], (
        "the hypothesis contains it already"
    )


def test_a_hypothesis_at_the_noise_has_no_look_alikes() -> None:
    cubic, gain = trial("cubic", confused_with=("gain",)), trial("gain")
    assert names(_look_alikes(state(cubic, gain), cast("Any", refit(cubic, excess=1.0)))) == [("gain",)]
    assert _look_alikes(state(cubic, gain), cast("Any", refit(cubic, excess=0.05))) == []
    assert _look_alikes(state(cubic, gain), cast("Any", refit(cubic, excess=0.05, predicted=0.05))) == []
    unpredicted = refit(cubic, excess=0.05, predicted=0.5)
    forces = state(cubic, gain)
    forces.data.kind = "forces"
    assert names(_look_alikes(forces, cast("Any", unpredicted))) == [("gain",)], "it may imitate the other"
    assert _look_alikes(state(cubic, gain), cast("Any", unpredicted)) == [], "a fit to tracks takes seconds"
    noise = cast("Any", refit(cubic, excess=0.05))
    forces.refits = [refit(gain)]
    assert _look_alikes(forces, noise) == [], "its fit has converged"
    forces.refits[0].fit.converged = False
    assert names(_look_alikes(forces, noise)) == [("gain",)]


def test_a_hypothesis_at_the_noise_competes_with_look_alikes_of_fewer_genes() -> None:
    """They may explain as much at a lower cost, such as a stall without a vortex what a stall with one explains."""
    mass, cubic = trial("point_mass", confused_with=("cubic",)), trial("cubic")
    assert len(mass.suspect.genes) > len(cubic.suspect.genes)
    found = _look_alikes(state(mass, cubic), cast("Any", refit(mass, excess=0.05)))
    assert names(found) == [("cubic",)]
    assert _look_alikes(state(mass, cubic), cast("Any", refit(cubic, excess=0.05))) == []


def test_fits_from_the_estimates_ignore_the_given_start() -> None:
    rig = PendulumRig()
    context = FitContext(rig, WhitenedData.of(recorded({})), InProcessEvaluator())
    known = SearchState(context, DiagnosisSpec(start={"stiffness": 0.25}))
    steps = run_search(known, rig.model.searched)
    next(steps)
    next(steps)
    assert known.initial_fit is not None
    assert known.initial_fit[1].values == pytest.approx({gene.name: gene.nominal for gene in GENES})


@pytest.mark.parametrize("exhaustive", [False, True])
def test_an_exhaustive_search_fits_every_pair(exhaustive: bool) -> None:
    few = ("cubic", "friction", "gain")
    context = FitContext(PendulumRig(), WhitenedData.of(recorded({"cubic.k3": 0.3})), InProcessEvaluator())
    searched = SearchState(context, DiagnosisSpec(suspects=few, exhaustive=exhaustive))
    stages = [stage for _, stage in run_search(searched, context.subject.model.searched)]
    pairs = {frozenset(one.names) for one in searched.refits if len(one.trials) == 2}
    assert (len(pairs) == 3) == exhaustive
    assert ("refit with friction and gain" in stages) == exhaustive
    assert searched.final_weights.refits[1:][int(np.argmax(searched.final_weights.evidence[1:]))].names == ("cubic",)
    if exhaustive:
        alone = {one.names[0]: one.fit.cost for one in searched.refits if len(one.trials) == 1}
        assert set(alone) == set(few)
        for one in searched.refits:
            assert all(one.fit.cost <= alone[name] + 1.0 for name in one.names), (
                "a pair never fits worse than its parts"
            )


def test_an_exhaustive_search_of_the_whole_library_is_refused() -> None:
    delfly, spec = wing_or_vehicle(load_dataset(ROOT / "examples/delfly")), DiagnosisSpec(exhaustive=True)
    why = r"exhaustive fits every pair of suspects, and there are \d+: name at most 20"
    with pytest.raises(ValueError, match=why):
        check(delfly, spec)
    with pytest.raises(ValueError, match=why):
        next(diagnose(delfly, spec, InProcessEvaluator()))


def test_stages_of_unknown_number_advance_the_progress() -> None:
    fractions = [fraction for fraction, _ in _towards(iter("stage" * 20), 0.45, 0.85, 5)]
    assert fractions == sorted(set(fractions))
    assert 0.45 < fractions[0] < 0.55
    assert fractions[4] == pytest.approx(0.45 + 0.4 * 0.632, abs=1e-3)
    assert fractions[-1] < 0.85
