from __future__ import annotations

import json
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.concealed import results
from benchmarks.concealed.answer import Answer, Secret
from benchmarks.concealed.exhaustive import Compared
from benchmarks.concealed.record_trial import Addition, Order, add, make
from benchmarks.concealed.running import Folders, diagnosed, task
from benchmarks.concealed.score import Mark, beats_apart, blank, failed, mark
from benchmarks.concealed.seal import MANIFEST, BrokenSealError, close, digest, open_seal, read, seal
from benchmarks.concealed.strength import rms
from benchmarks.concealed.suite import make as make_all
from benchmarks.concealed.table import Advised, Rate, Table, at
from benchmarks.concealed.trials import (
    EQUAL,
    VEHICLE,
    Trial,
    plan,
)
from wingfit.diagnosis.finding import Finding, Floors, GeneValue, Hypothesis, Interval, RecordingMisfit, Verdict, Where
from wingfit.records import Condition, load_dataset, wing_or_vehicle
from wingfit.report import finding_json

CONDITION = Condition(3.0, 0.05, 1e5, 293.15)
MASS = Secret("lumped_mass", True, "physics", 1.0, span=0.8, chord=0.3, phase=0.02, values={"lumped_mass.mass": 0.004})


def answer(*secrets: Secret, group: str = "listed", **changes: object) -> Answer:
    plain = Answer(
        "trial-0001", "listed", "wing", "4", "4", secrets, {"E_f": 5e6, "L_1": 0.4}, 2.0, 2.1, 0.0, 5e-4, 5e-4,
        {"a": CONDITION}, 11,
    )  # fmt: skip
    return replace(plain, group=group, **changes)  # type: ignore[arg-type]


def hypothesis(*effects: str, probability: float) -> Hypothesis:
    return Hypothesis(effects, "", "", "", "", probability, 0.0, 0.0, 1, 0.5, None, 1e-3, True)


def gene(name: str, value: float, spread: float | None) -> GeneValue:
    low, high = (None, None) if spread is None else (value - spread, value + spread)
    return GeneValue(name, "1", "", Interval(value, low, high))


def held_out(name: str, before: float, after: float) -> RecordingMisfit:
    return RecordingMisfit(
        name, True, 3.0, 0.0, 10.0, 0.0, Interval(before, None, None), Interval(after, None, None), 5e-4
    )


def finding(
    verdict: Verdict, named: tuple[str, ...] = (), top: tuple[str, ...] = (), genes: tuple[GeneValue, ...] = ()
) -> Finding:
    others = tuple(hypothesis(*top, probability=0.9) for _ in range(bool(top)))
    return Finding(
        dataset="d", kind="tracks", unit="m", model="", verdict=verdict, summary="", probabilities={verdict: 1.0},
        named=named, added_effects=named, strength=2.0, floors=Floors(5e-4, 0.5, None, "", 0.0, 5e-4),
        hypotheses=(hypothesis(probability=0.95), *others, hypothesis("backlash", probability=0.01)),
        indistinguishable=(),
        where=Where("", Interval(0.75, 0.7, 0.8), Interval(0.4, 0.3, 0.5), Interval(0.98, 0.9, 1.0), "z", (1.0,)),
        markers=(), phase_map=None, missing=(), recordings=(held_out("a", 2e-3, 6e-4), held_out("b", 2e-3, 6e-4)),
        proof=None, overlays=(), genes=genes, law=None, advice=(),
    )  # fmt: skip


def test_a_finding_that_names_the_hidden_effect_gets_the_best_score() -> None:
    found = finding("named", ("lumped_mass",), ("lumped_mass",), (gene("lumped_mass.mass", 0.005, 0.002),))
    marks = mark(found, answer(MASS))
    assert (marks.first, marks.exact, marks.wrong, marks.right_side, marks.found) == (True, True, False, True, 1)
    assert marks.span == pytest.approx(0.05)
    assert marks.chord == pytest.approx(0.1)
    assert marks.phase == pytest.approx(360 * 0.04)
    assert marks.held_out == pytest.approx(1.2)
    assert marks.worse is False
    assert (marks.covered, marks.intervals) == (1, 1)


def test_the_named_effects_place_has_priority_over_the_misfits() -> None:
    found = finding("named", ("lumped_mass",), ("lumped_mass",), (gene("lumped_mass.station", 0.82, 0.1),))
    assert mark(found, answer(MASS)).span == pytest.approx(0.02)
    assert mark(replace(found, named=("damage",)), answer(MASS)).span == pytest.approx(0.05)


def test_a_wrong_or_additional_name_is_wrong() -> None:
    other = mark(finding("named", ("damage",), ("damage",)), answer(MASS))
    assert (other.first, other.exact, other.wrong) == (False, False, True)
    more = mark(finding("named", ("lumped_mass", "damage"), ("lumped_mass",)), answer(MASS))
    assert (more.first, more.exact, more.wrong) == (True, False, True)


def test_an_ambiguous_verdict_names_nothing() -> None:
    marks = mark(finding("ambiguous", ("lumped_mass", "damage"), ("lumped_mass",)), answer(MASS))
    assert (marks.first, marks.exact, marks.wrong, marks.right_side) == (True, False, False, True)
    both_sides = mark(finding("ambiguous", ("lumped_mass", "camera_shift"), ("lumped_mass",)), answer(MASS))
    assert both_sides.right_side is False


@pytest.mark.parametrize(
    ("verdict", "alarm"), [("adequate", False), ("unnamed", True), ("ambiguous", True), ("named", True)]
)
def test_missing_physics_in_a_null_trial_is_a_false_alarm(verdict: Verdict, alarm: bool) -> None:
    found = finding(verdict, genes=(gene("C_l", 1.1, 0.2), gene("C_r", 2.0, 0.1)))
    marks = mark(found, answer(group="null", rig="vehicle", genome={"C_l": 1.0, "C_r": 1.5}))
    assert marks.alarm is alarm
    assert marks.first is None
    assert (marks.covered, marks.intervals) == (1, 2)


def test_a_wing_whose_densities_are_described_wrong_has_no_true_genes() -> None:
    found = finding("adequate", genes=(gene("E_f", 5e6, 2e5),))
    assert mark(found, answer(group="null", plant="8x1")).intervals == 0
    assert mark(found, answer(group="null")).intervals == 0


def test_a_fault_taken_for_physics_is_on_the_wrong_side() -> None:
    fault = Secret("camera_shift", True, "measurement", 1.0)
    assert mark(finding("measurement fault", ("camera_shift",)), answer(fault)).right_side
    assert not mark(finding("named", ("hinge_offset",)), answer(fault)).right_side
    assert not mark(finding("unnamed"), answer(fault)).right_side


def test_of_two_effects_the_named_ones_count() -> None:
    pair = answer(MASS, Secret("added_mass", True, "physics", 1.0), group="pairs")
    assert mark(finding("named", ("lumped_mass",), ("lumped_mass", "added_mass")), pair).found == 1
    assert mark(finding("ambiguous", ("damage",), ("lumped_mass", "added_mass")), pair).found == 2
    assert mark(finding("named", ("lumped_mass",)), pair).span is None


def test_phases_are_periodic() -> None:
    assert beats_apart(0.98, 0.02) == pytest.approx(0.04)
    assert beats_apart(0.25, 0.75) == pytest.approx(0.5)


def test_a_sealed_answer_is_read_back(tmp_path: Path) -> None:
    closed = close({"trial-0001": seal(answer(MASS), tmp_path)}, tmp_path)
    assert open_seal("trial-0001", tmp_path, closed) == answer(MASS)


@pytest.mark.parametrize("spoil", ["answer", "manifest"])
def test_a_changed_answer_is_refused(tmp_path: Path, spoil: str) -> None:
    closed = close({"trial-0001": seal(answer(MASS), tmp_path)}, tmp_path)
    path = tmp_path / "trial-0001.json"
    path.write_text(path.read_text().replace("lumped_mass", "added_mass"))
    if spoil == "manifest":  # even with a manifest to match
        (tmp_path / MANIFEST).write_text(json.dumps({"trial-0001": digest(path.read_text())}))
    with pytest.raises(BrokenSealError, match="run"):
        open_seal("trial-0001", tmp_path, closed)


def test_answers_in_a_closed_folder_cannot_be_replaced(tmp_path: Path) -> None:
    hashes = {"trial-0001": seal(answer(MASS), tmp_path)}
    assert close(hashes, tmp_path) == close(hashes, tmp_path)
    with pytest.raises(BrokenSealError, match="trial-0001"):
        close({"trial-0001": digest("another")}, tmp_path)


def test_existing_datasets_and_findings_are_reused(tmp_path: Path) -> None:
    folders, trial = Folders(tmp_path), vehicle_trial("stroke_amplitude")
    folders.findings.mkdir()
    make_all([trial], folders, 1)
    stamp = folders.dataset(trial.name).stat().st_mtime_ns
    make_all([trial], folders, 1)
    assert folders.dataset(trial.name).stat().st_mtime_ns == stamp
    with pytest.raises(ValueError, match="seed"):
        make_all([replace(trial, seed=78)], folders, 1)
    path = folders.findings / f"{trial.name}.json"
    path.write_text(json.dumps(finding_json(finding("unnamed"))))
    with ThreadPoolExecutor(1) as executor:
        (outcome,) = diagnosed(executor, [task(trial, trial.name, folders)], folders, "")
        assert outcome.finding == finding("unnamed")
        path.write_text(json.dumps({"failed": "it crashed"}))
        folders.dataset(trial.name).write_bytes(b"nothing")  # so that the diagnosis fails, and says so in its place
        (outcome,) = diagnosed(executor, [task(trial, trial.name, folders)], folders, "")
    assert outcome.finding is None
    assert "it crashed" not in path.read_text()


def test_wilson_interval_as_in_print() -> None:
    """Brown, Cai and DasGupta (2001): 0 of 10 at 95 % reaches 0.278; at 90 % z^2 / (n + z^2)."""
    assert Rate(0, 150).interval == pytest.approx((0.0, 100 * 1.6449**2 / (150 + 1.6449**2)), abs=0.05)
    assert Rate(50, 100).interval == pytest.approx((41.9, 58.1), abs=0.1)
    assert Rate(0, 0).percent is None


def trial_mark(n: int, group: str, strength: float, **changes: object) -> Mark:
    plain = blank(answer(*(() if group == "null" else (MASS,)), group=group, strength=strength), "adequate")
    return replace(plain, trial=f"trial-{n}", **changes)  # type: ignore[arg-type]


def test_trials_are_binned_by_their_measured_strength() -> None:
    marks = (
        trial_mark(0, "null", 0.0, verdict="adequate"),
        trial_mark(1, "null", 0.0, verdict="named", alarm=True, wrong=True, named=("damage",)),
        trial_mark(2, "listed", 2.1, first=True, exact=False, verdict="named", held_out=1.0, worse=False),
        trial_mark(3, "listed", 5.0, first=True, exact=True, verdict="named", held_out=1.2, worse=True),
        trial_mark(4, "listed", 1.0, first=False, exact=False),
        trial_mark(5, "unlisted", 2.5, verdict="unnamed", alarm=True),
        trial_mark(6, "unlisted", 2.5, verdict="named", named=("damage",), wrong=True, alarm=True),
    )
    advised = (Advised("trial-8", ("damage",), "ambiguous", ("damage", "backlash"), "fly", True, False),)
    figures = Table(marks, advised, 1, 3.0).as_json()
    assert figures["null"] == {"n": 2, "false_alarms": 1}
    assert figures["listed"] == {"n": 3, "top1_percent_d2": 100.0, "top1_percent_d5": 100.0, "exact_percent_d2": 0.0}
    assert figures["unlisted"] == {"n": 2, "detected_percent": 100.0, "unnamed_percent": 50.0}
    assert figures["wrong_name_percent"] == pytest.approx(28.6)
    assert figures["heldout_over_floor_median"] == pytest.approx(1.1)
    assert figures["heldout_worse_percent"] == 50.0
    assert figures["advice"] == {"n": 1, "resolved_percent": 100.0, "random_percent": 0.0}
    assert [row["trial"] for row in figures["failures"]] == ["trial-1", "trial-2", "trial-3", "trial-6"]
    assert {"seconds", "coverage_percent", "place", "pairs", "measurement", "rates"} <= set(figures)
    assert figures["rates"]["null: false alarms"][:2] == [1, 2]
    assert len(at(marks, 5)) == 1
    rows = Table((*marks, replace(marks[0], division="4", plant="8x1")), advised, 1, 3.0).rows()
    assert rows["wing 4 of 4: nulls without false alarm"].startswith(" 50.0 %  (1 of 2")
    assert rows["wing 4 of 8x1: nulls without false alarm"].startswith("100.0 %  (1 of 1")
    assert rows["wing 4 of 4: unlisted, left unnamed"].startswith(" 50.0 %  (1 of 2")
    json.dumps(figures)


def test_scores_of_parts_are_added_up(tmp_path: Path) -> None:
    path = tmp_path / "results" / "seed_8.jsonl"
    advised = (Advised("trial-1", ("damage",), "ambiguous", ("damage", "backlash"), None, True, False),)
    compared = (Compared("trial-1", ("damage",), ("damage", "backlash"), 0.2),)
    first = Table((trial_mark(0, "null", 0.0), trial_mark(1, "listed", 2.1)), advised, 1, 3.0, compared)
    second = Table((replace(trial_mark(2, "listed", 3.0), span=math.inf),), (), 0, 2.0)
    assert results.read(path, 8) is None
    results.append(path, 8, first)
    results.append(path, 8, second)
    assert results.read(path, 8) == Table((*first.marks, *second.marks), advised, 1, 5.0, compared)
    both = results.of_all_seeds([path, path], None, ())
    assert both.marks == 2 * (*first.marks, *second.marks)
    rig, group = first.marks[0].rig, first.marks[0].group
    assert all((one.rig, one.group) == (rig, group) for one in results.of_all_seeds([path], rig, [group]).marks)
    assert results.of_all_seeds([path], rig, ["drift"]).marks == ()
    assert results.joined([first, second]).compared_by_rig == {"wing": 1}
    with pytest.raises(ValueError, match="seed 8, not 9"):
        results.read(path, 9)
    results.append(path, 8, second)
    with pytest.raises(ValueError, match="twice"):
        results.read(path, 8)


def test_scores_of_another_plan_are_refused() -> None:
    """The names of the trials depend on whether a seed has trials in a vortex lattice."""
    trials, others = plan(8), plan(8, lattice=True)
    marks = tuple(
        replace(trial_mark(0, one.group, 1.0), trial=one.name, rig=one.build.rig, truth=one.hidden) for one in trials
    )
    results.check_plan(Table(marks, (), 0, 1.0), trials)
    results.check_plan(Table(marks, (), 0, 1.0), trials[::2])
    with pytest.raises(ValueError, match="vortex lattice"):
        results.check_plan(Table(marks, (), 0, 1.0), others)


def test_a_failed_diagnosis_gets_the_worst_score() -> None:
    table = Table((failed(answer(MASS), "ValueError: no"), failed(answer(group="null"), "")), (), 0, 1.0)
    figures = table.as_json()
    assert table.rates["listed, d = 2: top-1"].percent == 0.0
    assert table.failures[0]["what"] == "no finding: ValueError: no"
    assert figures["null"]["false_alarms"] == 1
    assert figures["wrong_name_percent"] == figures["heldout_worse_percent"] == 100.0
    assert table.coverage.percent == 0.0
    assert table.coverage.n == 1  # the mass
    assert figures["heldout_over_floor_median"] is None  # it is not finite
    assert figures["place"] == {"span_R": None, "chord_c": None, "phase_deg": None}
    json.dumps(figures, allow_nan=False)


def test_a_missing_place_has_infinite_distance() -> None:
    silent = replace(finding("unnamed"), where=None)
    marks = mark(silent, answer(MASS))
    assert (marks.span, marks.chord, marks.phase) == (math.inf, math.inf, math.inf)
    assert mark(silent, answer(replace(MASS, phase=None))).phase is None


def test_the_floor_does_not_include_discretisation_error() -> None:
    found = finding("named", ("lumped_mass",))
    boasting = replace(found, floors=replace(found.floors, discretisation=1e-2))
    assert mark(boasting, answer(MASS)).held_out == mark(found, answer(MASS)).held_out


def vehicle_trial(*hidden: str, group: str = "listed", target: float = 3.0) -> Trial:
    return Trial("trial-0007", group, VEHICLE, hidden, target, False, 77)  # type: ignore[arg-type]


def test_recording_a_trial_is_reproducible_and_reaches_the_target_strength(tmp_path: Path) -> None:
    orders = [Order(vehicle_trial("stroke_amplitude"), tmp_path / f"{k}.nc", tmp_path) for k in (1, 2)]
    hashes = [make(order) for order in orders]
    assert hashes[0] == hashes[1]
    one, two = (wing_or_vehicle(load_dataset(order.dataset)) for order in orders)
    assert all(np.array_equal(a.values, b.values) for a, b in zip(one.recordings, two.recordings, strict=True))
    truth = read(tmp_path / "trial-0007.json")
    assert truth.strength == pytest.approx(3.0, rel=0.35)
    assert truth.strength_of_division < 0.1  # plant and model are the same physics
    assert truth.secrets[0].values["stroke_amplitude.part"] == pytest.approx(truth.secrets[0].strength)
    assert len(one.held_out) == 2
    assert len(one.fitted) == 5
    for text in (one.name, one.description, *(r.name for r in one.recordings)):
        assert "stroke_amplitude" not in text
    assert all(r.standard_deviation is None for r in one.recordings)


def test_a_later_recording_is_of_the_same_rig(tmp_path: Path) -> None:
    trial = vehicle_trial("induced_inflow", group="advice")
    make(Order(trial, tmp_path / "a.nc", tmp_path))
    first = wing_or_vehicle(load_dataset(tmp_path / "a.nc"))
    again = first.recordings[0].condition
    assert add(Addition(trial, again, tmp_path / "a.nc", tmp_path / "b.nc", tmp_path))
    gale = replace(again, airspeed=40.0)  # a force of far more than ten times the weight
    assert not add(Addition(trial, gale, tmp_path / "a.nc", tmp_path / "c.nc", tmp_path))
    assert not (tmp_path / "c.nc").exists()
    longer = wing_or_vehicle(load_dataset(tmp_path / "b.nc"))
    assert longer.held_out == first.held_out
    assert len(longer.recordings) == len(first.recordings) + 1
    old, new = longer.recordings[0], longer.recordings[-1]
    assert new.name == f"{old.name}-again"
    assert not np.array_equal(old.values, new.values)  # other noise
    assert rms((old.values - new.values).ravel()) < 0.2 * rms(old.values.ravel())  # of the same forces


def test_a_null_trial_of_a_wing_has_no_hidden_effect(tmp_path: Path) -> None:
    trial = Trial("trial-0009", "null", EQUAL, (), 0.0, True, 5)
    make(Order(trial, tmp_path / "w.nc", tmp_path))
    truth = read(tmp_path / "trial-0009.json")
    assert truth.secrets == ()
    assert truth.strength == 0.0
    assert truth.strength_of_division < 0.1
    assert 1e-4 < truth.noise < 1.2e-3
