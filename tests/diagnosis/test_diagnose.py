"""Whole diagnoses of a rig with one degree of freedom: concealed effects are named, unlisted physics is not."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import FREQUENCIES, Pendulum, PendulumRig, at, blank, recorded
from wingfit.checks import Mistake
from wingfit.checks.guard import NOT_CARRIED_OUT
from wingfit.checks.mistake import EVERY
from wingfit.diagnosis import DiagnosisSpec, Finding, diagnose_subject
from wingfit.diagnosis.diagnose import _likely_mistakes
from wingfit.records import AnyDataset, Recording, load_dataset
from wingfit.report import finding_from_json, finding_json, html
from wingfit.report.page import headline
from wingfit.workers.in_process import InProcessEvaluator

ROOT = Path(__file__).parents[2]
HELD_OUT = (1.45, 2.3, 3.0)  # Hz
NOMINAL = {"stiffness": 0.25, "damping": 3e-3, "inertia": 1.2e-3}  # not the estimates


def finding(
    truth: Mapping[str, float], seed: int = 1, spec: DiagnosisSpec | None = None, *, validate: bool = True
) -> Finding:
    fitted = recorded({**NOMINAL, **truth}, noise=5e-4, seed=seed)
    held_out = recorded({**NOMINAL, **truth}, noise=5e-4, seed=seed + 1, frequencies=HELD_OUT) if validate else ()
    return diagnosed(fitted, held_out, spec)


def diagnosed(
    fitted: tuple[Recording, ...],
    held_out: tuple[Recording, ...] = (),
    spec: DiagnosisSpec | None = None,
    mistakes: tuple[Mistake, ...] = (),
) -> Finding:
    settings, evaluator = spec or DiagnosisSpec(), InProcessEvaluator()
    steps = list(diagnose_subject(PendulumRig(), "pendulum", fitted, held_out, settings, evaluator, mistakes=mistakes))
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    found = steps[-1].finding
    assert found is not None
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    return found


@pytest.mark.parametrize("seed", range(6))
def test_wrong_parameters_and_coloured_noise_are_no_missing_physics(seed: int) -> None:
    found = finding({}, seed)
    assert found.verdict == "adequate"
    assert found.strength == pytest.approx(1.0, abs=0.03)
    assert found.proof is not None
    assert found.proof.after.value == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("truth", "verdict"),
    [
        ({"cubic.k3": 0.3}, "named"),
        ({"friction.torque": 2e-3}, "named"),
        ({"point_mass.mass": 5e-3, "point_mass.station": 0.5}, "named"),
        ({"gain.part": 0.02}, "measurement fault"),
        ({"delay.time": 4e-3}, "measurement fault"),
    ],
)
def test_a_concealed_effect_is_named_and_validated(truth: dict[str, float], verdict: str) -> None:
    name = next(iter(truth)).split(".")[0]
    found = finding(truth)
    assert (found.verdict, found.named) == (verdict, (name,))
    assert found.strength > 1.0
    genes = {gene.name: gene.value for gene in found.genes}
    for gene, value in truth.items():
        interval = genes[gene]
        low, high = (
            (-np.inf if interval.low is None else interval.low),
            (np.inf if interval.high is None else interval.high),
        )
        assert low - 0.5 * (high - low) <= value <= high + 0.5 * (high - low)
    assert found.proof is not None
    assert found.proof.improved
    assert found.proof.after.value < 1.1 < 1.1 * found.proof.before.value


def test_likely_mistakes_of_the_dataset_speak_against_a_name() -> None:
    fitted = recorded({**NOMINAL, "friction.torque": 2e-3}, noise=5e-4, seed=1)
    sure = diagnosed(fitted)
    wrong = Mistake("vertical sign", "all recordings", "0.07 rad", "0.003 rad", "z points down", "the sign of z")
    found = diagnosed(fitted, mistakes=(wrong,))
    assert (sure.verdict, found.verdict, found.named) == ("named", "unnamed", ())
    assert found.probabilities["named"] == pytest.approx(0.5 * sure.probabilities["named"])
    assert "too little for a name." in found.summary
    assert "likely mistakes (vertical sign), and one of them may be the cause" in found.summary
    assert found.summary.endswith("No effect is named until then.")
    assert (found.advice, bool(sure.advice)) == ((), True)
    assert found.hypotheses[0].probability == pytest.approx(0.5 * sure.hypotheses[0].probability)
    assert headline(found) == "Missing physics; whether an effect of the library explains it is not certain"
    assert found.remarks[0].startswith("likely mistake in the dataset: all recordings, vertical sign: 0.07 rad")


def test_likely_mistakes_that_no_effect_imitates_leave_the_name() -> None:
    fitted = recorded({**NOMINAL, "friction.torque": 2e-3}, noise=5e-4, seed=1)
    unusual = Mistake("mass", "dataset.yaml: wing.markers", "2 kg", "1 g", "grams for kilograms", "mass_kg")
    found = diagnosed(fitted, mistakes=(unusual,))
    assert (found.verdict, found.named) == ("named", ("friction",))
    assert found.summary == diagnosed(fitted).summary
    assert found.remarks[0].startswith("likely mistake in the dataset: dataset.yaml")


def test_a_check_that_fails_is_no_mistake_of_the_dataset(monkeypatch: pytest.MonkeyPatch) -> None:
    failed = Mistake(NOT_CARRIED_OUT, "dataset", "no check", "a result", "an error", "nothing")
    wrong = Mistake("frequency", "recording 'a'", "3 Hz", "4 Hz", "a typing error", "flap_frequency_hz")
    examined_is(monkeypatch, lambda _: (failed, wrong))
    dataset = load_dataset(ROOT / "examples" / "robird")
    assert _likely_mistakes(dataset, dataset.recordings) == ((wrong,), ())


def test_mistakes_in_other_recordings_are_not_those_of_the_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = load_dataset(ROOT / "examples" / "robird")
    first, *others = dataset.recordings
    found = [Mistake(kind, EVERY, "one", "another", "a slip", "the key") for kind in ("scale", "frequency")]
    examined_is(monkeypatch, lambda given: found if first in given.recordings else found[1:])
    assert _likely_mistakes(dataset, (first,)) == (tuple(found), ())
    shown, remarks = _likely_mistakes(dataset, others)
    assert shown == tuple(found[1:])
    assert remarks == (f"likely mistake in the dataset that the fitted recordings do not show: {found[0]}",)


def examined_is(monkeypatch: pytest.MonkeyPatch, examine: Callable[[AnyDataset], Sequence[Mistake]]) -> None:
    module = importlib.import_module("wingfit.diagnosis.diagnose")  # whose name in the package is the function
    monkeypatch.setattr(module, "examine", examine)


def test_progress_shows_where_the_nominal_model_misses_and_what_leads() -> None:
    fitted = recorded({**NOMINAL, "friction.torque": 2e-3}, noise=5e-4, seed=1)
    steps = list(diagnose_subject(PendulumRig(), "pendulum", fitted, (), DiagnosisSpec(), InProcessEvaluator()))
    known = [step.partial for step in steps]
    assert known[0] is None
    assert known[-1] is None  # the finding is there
    shown = [one for one in known if one is not None]
    assert [one.tested for one in shown] == sorted(one.tested for one in shown)
    last, found = shown[-1], steps[-1].finding
    assert found is not None
    assert (last.leads[0].effects, last.leads[0].refitted) == (("friction",), True)
    assert last.leads[0].explained > 0.95
    assert last.suspects == len(PendulumRig().suspects)
    assert last.misfit > 1.2 * last.noise
    assert [(one.name, one.misfit) for one in last.places] == [(one.name, one.before) for one in found.markers]


@pytest.mark.parametrize("fails", [(3.0,), HELD_OUT])
def test_unpredicted_recordings_do_not_validate(monkeypatch: pytest.MonkeyPatch, fails: tuple[float, ...]) -> None:
    """With the effect added, the model finds no motion under some, or all, held-out conditions."""
    truth = {**NOMINAL, "friction.torque": 2e-3}
    fitted, held_out = recorded(truth, noise=5e-4, seed=1), recorded(truth, noise=5e-4, seed=2, frequencies=HELD_OUT)
    seen = Pendulum._seen

    def failing(self: Pendulum, values: Mapping[str, float], recording: Recording) -> np.ndarray:
        lost = values.get("friction.torque", 0.0) > 0.0 and recording.condition.flap_frequency in fails
        return np.full(recording.values.shape, np.nan) if lost else seen(self, values, recording)

    monkeypatch.setattr(Pendulum, "_seen", failing)
    found = diagnosed(fitted, held_out)
    assert found.named == ("friction",)
    assert sum(
        "was not predicted: the model with the added effects fails" in remark for remark in found.remarks
    ) == len(fails)
    validated = [one for one in found.recordings if one.held_out]
    assert len(validated) == len(HELD_OUT) - len(fails)
    assert all(one.after.value > 0.0 for one in validated)
    if found.proof is None:
        assert "not validated" in found.summary
    else:
        assert not found.proof.improved
        assert found.proof.after.value == pytest.approx(1.0, abs=0.1)
    assert finding_from_json(finding_json(found)) == found
    assert "was not predicted" in html(found)


def test_two_effects_together_are_both_named() -> None:
    found = finding({"friction.torque": 2e-3, "gain.part": 0.03})
    assert set(found.named) == {"friction", "gain"}


@pytest.mark.parametrize("seed", range(3))
def test_physics_outside_the_library_is_unnamed(seed: int) -> None:
    """A motor whose torque has a second harmonic, which no suspect has."""
    values = np.array([[NOMINAL[gene.name] for gene in Pendulum().genes]])
    rng, records = np.random.default_rng(seed), []
    for frequency in FREQUENCIES:
        empty = blank(at(frequency))
        seen = Pendulum(torque=(0.015, 0.002)).observe(values, empty).channels[0]
        records.append(replace(empty, values=seen + 5e-4 * rng.standard_normal(seen.shape)))
    found = diagnosed(tuple(records))
    assert found.verdict == "unnamed"
    assert found.named == ()
    assert found.where is not None
    assert int(np.argmax(found.where.harmonics)) == 2
    assert "2 per beat" in found.where.words


def test_the_same_recordings_give_the_same_finding() -> None:
    one, other = (finding({"cubic.k3": 0.3}) for _ in range(2))
    assert replace(one, seconds=0.0) == replace(other, seconds=0.0)


def test_a_finding_becomes_a_report_and_round_trips_as_json() -> None:
    found = finding({"friction.torque": 2e-3})
    assert finding_from_json(finding_json(found)) == found
    assert "Dry friction" in html(found)


def test_without_held_out_recordings_the_summary_says_not_validated() -> None:
    found = finding({"gain.part": 0.02}, validate=False)
    assert found.proof is None
    assert "not validated" in found.summary


def test_a_held_out_copy_does_not_validate() -> None:
    fitted = recorded({**NOMINAL, "gain.part": 0.02}, noise=5e-4)
    found = diagnosed(fitted, (replace(fitted[2], name="copy"),))
    assert found.proof is None
    assert any("held-out recording copy is a copy of" in remark for remark in found.remarks)


def test_a_marker_that_never_moves_is_ignored_with_a_remark() -> None:
    """Its misfit is no missing physics."""
    fitted = recorded({**NOMINAL, "friction.torque": 2e-3}, noise=5e-4)
    stuck = []
    for one in fitted:
        values = one.values.copy()
        values[:, 3:6] = [0.0, 0.17, 0.01]
        stuck.append(replace(one, values=values))
    found = diagnosed(tuple(stuck))
    assert found.named == ("friction",)
    assert any("the recorded position of middle never changes" in remark for remark in found.remarks)


def test_an_adequate_model_has_no_location() -> None:
    assert finding({}).where is None


def test_an_unknown_suspect_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown suspect 'ghost'"):
        finding({}, spec=DiagnosisSpec(suspects=("ghost",)))


def test_only_requested_suspects_are_tested() -> None:
    found = finding({"gain.part": 0.02}, spec=DiagnosisSpec(suspects=("delay", "cubic")))
    assert {name for h in found.hypotheses for name in h.effects} <= {"delay", "cubic"}
    assert found.verdict == "unnamed"
