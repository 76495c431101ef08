from __future__ import annotations

import json
import webbrowser
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.concealed.trials import chamber
from benchmarks.proof import continuous, delfly, robird
from benchmarks.proof.__main__ import main
from benchmarks.proof.delfly import FLING, Lift
from benchmarks.proof.robird import HIDDEN, Campaign, Stall
from benchmarks.proof.story import Claim, Story, beside_truth, families, leader, opened, over_floor, saved
from tests.report.findings import force_finding, wing_finding
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.result import Result
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.finding import GeneValue, Interval, Proof
from wingfit.records import Dataset, load_dataset
from wingfit.sim.virtual_rigs.balance import TRIALS
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.workers import make_evaluator

PAGE = Path("page.html")
FEW = (TRIALS[1], TRIALS[4])
PLACES = {"test-2": (0.06, 0.32), "test-5": (0.07, 0.31)}


@pytest.fixture(scope="module")
def evaluator() -> Evaluator:
    return make_evaluator("in_process")


@pytest.fixture(scope="module")
def filmed() -> Campaign:
    return robird.campaign(4)


@pytest.fixture(scope="module")
def weighed() -> Dataset:
    return delfly.campaign(4, FEW, held_out=("test-5",))


class Browser(webbrowser.GenericBrowser):
    """A browser that records the opened addresses."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.seen: list[str] = []

    def open(self, url: str, new: int = 0, autoraise: bool = True) -> bool:  # noqa: ARG002
        self.seen.append(url)
        return True


def held(story: Story) -> list[bool]:
    return [claim.holds for claim in story.claims]


def test_the_robirds_description_does_not_contain_hidden_effects(filmed: Campaign) -> None:
    dataset = filmed.dataset
    assert dataset.wing == robird_wing()
    assert len(dataset.recordings) == len({r.name for r in dataset.recordings}) == 7
    fitted = {r.condition for r in dataset.recordings if r.name not in dataset.held_out}
    assert not fitted & {r.condition for r in dataset.recordings if r.name in dataset.held_out}
    assert len(dataset.held_out) == 2


def test_true_genes_belong_to_the_hidden_effects(filmed: Campaign) -> None:
    truth, hinge = filmed.truth, HIDDEN["hinge_offset"]
    assert {name.partition(".")[0] for name in truth} == set(HIDDEN)
    assert np.hypot(truth["hinge_offset.y"], truth["hinge_offset.z"]) == pytest.approx(hinge["strength"])
    assert truth["drive_harmonics.cos2"] ** 2 + truth["drive_harmonics.sin2"] ** 2 > 0.02**2


def test_hidden_effects_move_the_markers_by_centimetres(filmed: Campaign) -> None:
    bare = robird.campaign(4, hidden={}).dataset
    for one, other in zip(filmed.dataset.recordings, bare.recordings, strict=True):
        apart = (one.values - other.values).reshape(len(one.times), -1, 3)
        assert np.nanmean(np.linalg.norm(apart, axis=2)) > robird.CENTIMETRES


def test_the_true_model_fits_better_than_the_description_but_not_below_the_noise(filmed: Campaign) -> None:
    quiet = robird.campaign(4, hidden={})
    noise, described = quiet.left_by_truth(), replace(filmed, truth={}).left_by_truth()
    assert 0.9 * noise < filmed.left_by_truth() < 0.2 * described


def test_the_thesis_search_reports_where_it_ended(filmed: Campaign, evaluator: Evaluator) -> None:
    chosen = [r for r in filmed.dataset.recordings if r.condition in (chamber(1e3, 0.0, 2.0), robird.FITTED[3])]
    small = replace(filmed.dataset, recordings=tuple(chosen), held_out=())
    spec = CalibrationSpec(division="4", population=6, max_generations=1)
    found = robird.stall(small, evaluator, spec=spec)
    assert found.stalled
    assert found.result.after >= robird.CENTIMETRES
    cut = robird.stall(small, evaluator, seconds=0.0, spec=spec)
    assert not cut.stalled
    assert cut.generations < found.generations


def test_the_recent_gain_of_a_search_is_that_of_its_last_stage() -> None:
    assert robird.gained(["a", "a", "b", "b"], [0.04, 0.03, 0.02, 0.015]) == pytest.approx(0.25)
    assert robird.gained(["a"] * 12, [0.05, 0.04, *[0.03] * 10]) == pytest.approx(0.25)
    assert robird.gained(["a"], [0.02]) == 0.0


def test_the_robird_claims_fail_if_the_diagnosis_is_wrong(filmed: Campaign) -> None:
    made = replace(filmed, truth={"hinge_offset.y": 0.0120, "hinge_offset.z": -0.005})
    search = Stall(Result((), (), 0.03, 0.02, 0.031, 0.021, 3e-4), 0.01, 30, 1500, 60.0, stalled=True)
    found, proof = wing_finding(), Proof(Interval(4.4, 4.1, 4.7), Interval(1.04, 1.0, 1.1), 1e-3, True, "")
    found = replace(found, proof=proof)
    story = robird.story_of(made, search, found, PAGE)
    assert held(story) == [True] * 5
    assert [row["covered"] for row in story.figures["genes"]] == [True, False]
    assert story.figures["stall_mm"] == pytest.approx(20.0)
    wrong = replace(found, named=("camera_rotation",), verdict="measurement fault")
    assert held(robird.story_of(made, search, wrong, PAGE)) == [True, False, False, True, True]
    assert held(robird.story_of(made, search, replace(found, named=()), PAGE)) == [True, False, False, True, True]
    worse = replace(found, proof=replace(proof, after=Interval(1.2, 1.1, 1.3)))
    assert held(robird.story_of(made, search, worse, PAGE))[3:] == [False, True]
    far = replace(found, proof=replace(proof, floor=1.3 * made.left_by_truth()))
    assert held(robird.story_of(made, search, far, PAGE))[3:] == [True, False]
    assert held(robird.story_of(made, search, replace(found, proof=None), PAGE))[3:] == [False, False]
    moving = replace(search, stalled=False, gain=0.1)
    assert held(robird.story_of(made, moving, found, PAGE))[0] is False
    near = replace(search, result=replace(search.result, after=0.004))
    assert held(robird.story_of(made, near, found, PAGE))[0] is False


def test_the_claims_of_the_continuous_wing_fail_if_the_diagnosis_is_wrong(filmed: Campaign) -> None:
    made = replace(filmed, truth={"hinge_offset.y": 0.0120, "hinge_offset.z": -0.0015})
    proof = Proof(Interval(4.4, 4.1, 4.7), Interval(1.04, 1.0, 1.1), 1e-3, True, "")
    remarks = ("the described rest positions of the markers are wrong by about 0.7 mm along each axis",)
    found = replace(wing_finding(), named=("hinge_offset",), proof=proof, remarks=remarks)
    assert held(continuous.story_of(made, found, PAGE)) == [True] * 4
    assert held(continuous.story_of(made, wing_finding(), PAGE))[0] is False, "the drive is right"
    far = replace(made, truth={"hinge_offset.y": 0.0120, "hinge_offset.z": -0.005})
    assert held(continuous.story_of(far, found, PAGE)) == [True, False, True, True]
    assert held(continuous.story_of(made, replace(found, genes=()), PAGE))[1] is False
    assert held(continuous.story_of(made, replace(found, remarks=()), PAGE))[2] is False
    worse = replace(found, proof=replace(proof, after=Interval(1.2, 1.1, 1.3)))
    assert held(continuous.story_of(made, worse, PAGE))[3] is False


def test_an_effect_that_is_not_named_has_no_estimate() -> None:
    genes = {"a.b": GeneValue("a.b", "1", "", Interval(0.5, 0.4, None), 0.0)}
    named, absent = beside_truth(genes, {"a.b": 0.45, "c.d": 1.0})
    assert (named["found"], named["covered"]) == (0.5, None)
    assert (absent["found"], absent["covered"]) == (None, None)


def test_the_named_hypothesis_has_priority_over_the_most_probable() -> None:
    found = wing_finding()
    turned = replace(found, hypotheses=found.hypotheses[::-1])
    assert leader(turned).effects == found.named
    assert families(found) == ("actuation", "actuation")
    assert over_floor(found)["heldout_over_floor"] == pytest.approx(1.04)


def test_the_delfly_tests_have_their_conditions_and_reproducible_noise(weighed: Dataset) -> None:
    again = delfly.campaign(4, FEW, held_out=("test-5",))
    assert [r.condition for r in weighed.recordings] == [trial.condition for trial in FEW]
    for one, other in zip(weighed.recordings, again.recordings, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


def test_the_nominal_model_misfits_only_while_the_wings_peel(weighed: Dataset, evaluator: Evaluator) -> None:
    places = delfly.located(weighed, evaluator, FEW)
    assert list(places) == ["test-2"]
    assert places["test-2"] is not None
    assert places["test-2"][1] < delfly.FLING_ENDS
    nothing_lacks = delfly.campaign(4, FEW, held_out=("test-5",), without=(FLING, "effective_chord"))
    assert delfly.located(nothing_lacks, evaluator, FEW) == {"test-2": None}


def test_lift_agrees_better_with_the_fling(weighed: Dataset, evaluator: Evaluator) -> None:
    value = {"C_l": 1.3, "C_r": 1.42, "clap_and_peel.coefficient": 1.6}
    genes = tuple(GeneValue(name, "1", "", Interval(one, None, None)) for name, one in value.items())
    lift = delfly.lifts(weighed, replace(force_finding(), genes=genes), evaluator)
    assert [one.held_out for one in lift] == [False, True]
    for one in lift:
        assert one.before < delfly.AS_IN_TABLE_7 < one.after


def test_the_delfly_claims_fail_if_the_diagnosis_is_wrong() -> None:
    lift = (
        Lift("test-2", held_out=False, before=0.90, after=0.99),
        Lift("test-5", held_out=True, before=0.9, after=0.98),
    )
    found = force_finding()
    story = delfly.story_of(found, PLACES, lift, PAGE)
    assert held(story) == [True] * 6
    assert story.figures["misfit_tstar_range"] == (0.06, 0.32)
    assert story.figures["lift_correlation_after"] == pytest.approx(0.985)
    assert found.where is not None
    late = replace(found, where=replace(found.where, phase=Interval(0.3, 0.1, 0.45)))
    assert held(delfly.story_of(late, PLACES, lift, PAGE))[0] is False
    spread = replace(found, where=replace(found.where, phase=None))
    assert held(delfly.story_of(spread, PLACES, lift, PAGE))[0] is False
    assert held(delfly.story_of(found, PLACES | {"test-5": None}, lift, PAGE))[1] is False
    assert held(delfly.story_of(replace(found, named=("wake_capture",)), PLACES, lift, PAGE))[2:4] == [False, False]
    more = replace(found, named=(FLING, "wake_capture"))
    assert held(delfly.story_of(more, PLACES, lift, PAGE))[2:4] == [True, False]
    low = (replace(lift[0], after=0.91), replace(lift[1], after=0.89))
    assert held(delfly.story_of(found, PLACES, low, PAGE))[4:] == [False, False]


def test_a_page_is_opened_in_graphical_browsers_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, expected in (("firefox", True), ("lynx", False)):
        browser = Browser(name)
        monkeypatch.setattr(webbrowser, "get", lambda one=browser: one)
        assert opened(tmp_path / "x.html") is expected
        assert browser.seen == ([(tmp_path / "x.html").resolve().as_uri()] if expected else [])

    def none() -> None:
        raise webbrowser.Error("no browser")

    monkeypatch.setattr(webbrowser, "get", none)
    assert not opened(tmp_path / "x.html")


@pytest.mark.parametrize("holds", [True, False])
def test_the_command_ends_with_figures_and_fails_with_a_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str], holds: bool
) -> None:
    story = Story({"stall_mm": 20.0}, ("it stalls",), (Claim("it is so", holds),), tmp_path / "robird.html")
    monkeypatch.setattr(robird, "play", lambda *_: story)
    assert main(["--only", "robird", "--json", "--no-browser", "--out", str(tmp_path)]) == (0 if holds else 1)
    last = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    assert last["robird"]["stall_mm"] == 20.0
    assert last["robird"]["claims"] == [{"words": "it is so", "holds": holds}]
    assert "delfly" not in last


def test_a_dataset_replaces_an_earlier_dataset_only(weighed: Dataset, tmp_path: Path) -> None:
    (tmp_path / "delfly").mkdir()
    kept = tmp_path / "delfly" / "notes.txt"
    kept.write_text("mine")
    with pytest.raises(ValueError, match="not an empty folder"):
        saved(weighed, tmp_path)
    assert kept.exists()
    kept.unlink()
    for _ in range(2):
        assert len(load_dataset(saved(weighed, tmp_path)).recordings) == len(weighed.recordings)
