"""Which trials there are, and their conditions."""

from __future__ import annotations

import numpy as np

from benchmarks.concealed.answer import GROUPS
from benchmarks.concealed.benches.wing import WingBench
from benchmarks.concealed.plant.continuum.simulate import EFFECTS as ROD_EFFECTS
from benchmarks.concealed.plant.measurement import balance, film
from benchmarks.concealed.plant.wing.build import Draft
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS, UNKNOWN
from benchmarks.concealed.plant.wing_effects.hidden import Hidden
from benchmarks.concealed.rigs import WINGS
from benchmarks.concealed.trials import (
    COUNTS,
    DRIFTS,
    LATTICE,
    ROD,
    THICK_PA,
    Build,
    any_condition,
    chamber,
    conditions,
    flight,
    name_of,
    plan,
)
from wingfit.sim.effects.registry import EFFECTS


def test_the_plan_has_the_requested_trials_and_names_reveal_nothing() -> None:
    trials = plan(3)
    by_group: dict[str, list[tuple[str, ...]]] = {}
    for trial in trials:
        by_group.setdefault(trial.group, []).append(trial.hidden)
    assert len(by_group["null"]) >= 150
    listed = by_group["listed"]
    assert sum(listed.count(kind) >= COUNTS["listed"] for kind in set(listed)) >= 12
    unlisted = by_group["unlisted"]
    assert sum(unlisted.count(kind) >= COUNTS["unlisted"] for kind in set(unlisted)) >= 5
    assert len(by_group["measurement"]) >= 60
    assert len(by_group["pairs"]) >= 21
    assert sum(trial.build.plant != trial.build.division for trial in trials) >= len(trials) / 3
    assert {trial.build.division for trial in trials} == {"", "4", "8x1", "11", "24"}
    assert len({trial.name for trial in trials}) == len(trials) == len({trial.seed for trial in trials})
    physics = {kind for (kind,) in set(unlisted)} - set(film.FAULTS) - set(balance.FAULTS)
    assert len(physics & set(UNKNOWN)) >= 3  # of the wing's plant
    assert len(physics - set(UNKNOWN)) >= 2  # of the vehicle's
    groups = [trial.group for trial in trials[:60]]
    assert len(set(groups)) >= 4  # names are dealt at random
    assert trials == plan(3)
    assert trials != plan(4)
    assert plan(3, only=["pairs"]) == tuple(trial for trial in trials if trial.group == "pairs")


def test_every_effect_of_the_library_is_hidden() -> None:
    hidden = {name for trial in plan(3) for name in trial.hidden}
    assert set(EFFECTS) - hidden == set()


def test_every_wing_can_have_what_a_trial_hides_in_it() -> None:
    pairs = {(t.build.body, name) for t in plan(3) if t.build.rig == "wing" for name in t.hidden if name in KINDS}
    for body, name in sorted(pairs):
        wing, grid = WINGS[body]
        genome = {gene.name: gene.nominal for gene in WingBench(Build("wing", "4", "4", body=body)).model.genes}
        draft = Draft(wing, "4", genome, chamber(THICK_PA, 0.05, grid.frequencies[2]))
        Hidden.one(name, KINDS[name].typical).put_into(draft)
        assert draft.joints, (body, name)


def test_a_plant_of_another_kind_is_in_every_group_of_wings() -> None:
    trials = plan(3, lattice=True)
    assert {trial.group for trial in trials if trial.build.plant == ROD} >= set(GROUPS) - {"every"}
    rods = {name for trial in trials if trial.build.plant == ROD for name in trial.hidden}
    assert rods <= {*ROD_EFFECTS, *film.FAULTS, *DRIFTS}
    of_lattice = [trial for trial in trials if trial.build.plant == LATTICE]
    assert {trial.group for trial in of_lattice} == {"null", "listed", "measurement"}
    assert not any(trial.build.plant == LATTICE for trial in plan(3))


def test_the_quick_sample_has_every_group_and_both_rigs() -> None:
    sample = plan(1, quick=True)
    assert len(sample) <= 40
    for group in GROUPS:
        rigs = {trial.build.rig for trial in sample if trial.group == group}
        assert rigs == ({"wing"} if group == "drift" else {"wing", "vehicle"}), group


def test_few_flights_are_as_alike_as_can_be() -> None:
    for trial in (one for one in plan(2) if one.poor and one.build.rig == "vehicle"):
        drawn = [one for one, _ in conditions(trial, np.random.default_rng(trial.seed))]
        places = [[flight(*one) for one in trial.build.grid.flights].index(one) for one in drawn]
        assert np.diff(places).tolist() == [1, 1]


def test_conditions_suit_the_rig() -> None:
    for trial in plan(1, quick=True):
        rng = np.random.default_rng(trial.seed)
        drawn = conditions(trial, rng)
        assert len({name_of(condition) for condition, _ in drawn}) == len(drawn)
        assert any(held for _, held in drawn)
        known = {name_of(one) for one, _ in drawn}
        another = any_condition(trial, known, rng)
        assert name_of(another) not in known
        for condition in [*(one for one, _ in drawn), another]:
            if trial.build.rig == "wing":
                grid = trial.build.grid
                assert condition.flap_frequency in grid.frequencies
                assert condition.airspeed in (0.0, *grid.speeds)
