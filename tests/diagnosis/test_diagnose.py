"""The whole way on a rig of one degree of freedom: what is concealed is named, what is not in the library is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import FREQUENCIES, Pendulum, PendulumRig, at, blank, recorded
from wingfit.diagnosis import DiagnosisSpec, Finding, diagnose_subject
from wingfit.records import Recording
from wingfit.report import finding_from_json, finding_json, html
from wingfit.workers.in_process import InProcessEvaluator

HELD_OUT = (1.45, 2.3, 3.0)  # Hz
NOMINAL = {"stiffness": 0.25, "damping": 3e-3, "inertia": 1.2e-3}  # not the estimates


def finding(
    truth: Mapping[str, float], seed: int = 1, spec: DiagnosisSpec | None = None, *, prove: bool = True
) -> Finding:
    fitted = recorded({**NOMINAL, **truth}, noise=5e-4, seed=seed)
    held_out = recorded({**NOMINAL, **truth}, noise=5e-4, seed=seed + 1, frequencies=HELD_OUT) if prove else ()
    return diagnosed(fitted, held_out, spec)


def diagnosed(
    fitted: tuple[Recording, ...], held_out: tuple[Recording, ...] = (), spec: DiagnosisSpec | None = None
) -> Finding:
    steps = list(
        diagnose_subject(PendulumRig(), "pendulum", fitted, held_out, spec or DiagnosisSpec(), InProcessEvaluator())
    )
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
def test_what_is_concealed_is_named_and_proved(truth: dict[str, float], verdict: str) -> None:
    name = next(iter(truth)).split(".")[0]
    found = finding(truth)
    assert (found.verdict, found.named) == (verdict, (name,))
    assert found.strength > 1.0
    genes = {gene.name: gene.value for gene in found.genes}
    for gene, value in truth.items():
        told = genes[gene]
        low, high = (-np.inf if told.low is None else told.low), (np.inf if told.high is None else told.high)
        assert low - 0.5 * (high - low) <= value <= high + 0.5 * (high - low)
    assert found.proof is not None
    assert found.proof.improved
    assert found.proof.after.value < 1.1 < 1.1 * found.proof.before.value


@pytest.mark.parametrize("fails", [(3.0,), HELD_OUT])
def test_what_cannot_be_predicted_proves_nothing(monkeypatch: pytest.MonkeyPatch, fails: tuple[float, ...]) -> None:
    """With the effect put in the model finds no motion under some, or all, held-out conditions."""
    truth = {**NOMINAL, "friction.torque": 2e-3}
    fitted, held_out = recorded(truth, noise=5e-4, seed=1), recorded(truth, noise=5e-4, seed=2, frequencies=HELD_OUT)
    seen = Pendulum._seen

    def failing(self: Pendulum, values: Mapping[str, float], recording: Recording) -> np.ndarray:
        lost = values.get("friction.torque", 0.0) > 0.0 and recording.condition.flap_frequency in fails
        return np.full(recording.values.shape, np.nan) if lost else seen(self, values, recording)

    monkeypatch.setattr(Pendulum, "_seen", failing)
    found = diagnosed(fitted, held_out)
    assert found.named == ("friction",)
    assert sum("was not predicted: what was found fails there" in remark for remark in found.remarks) == len(fails)
    proved = [one for one in found.recordings if one.held_out]
    assert len(proved) == len(HELD_OUT) - len(fails)
    assert all(one.after.value > 0.0 for one in proved)
    if found.proof is None:
        assert "nothing proves it" in found.summary
    else:
        assert not found.proof.improved
        assert found.proof.after.value == pytest.approx(1.0, abs=0.1)
    assert finding_from_json(finding_json(found)) == found
    assert "was not predicted" in html(found)


def test_two_at_once_are_both_named() -> None:
    found = finding({"friction.torque": 2e-3, "gain.part": 0.03})
    assert set(found.named) == {"friction", "gain"}


@pytest.mark.parametrize("seed", range(3))
def test_what_is_not_in_the_library_stays_unnamed(seed: int) -> None:
    """A motor whose torque has a second harmonic: no suspect makes one."""
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


def test_a_finding_makes_a_report_and_survives_its_file() -> None:
    found = finding({"friction.torque": 2e-3})
    assert finding_from_json(finding_json(found)) == found
    assert "Dry friction" in html(found)


def test_without_held_out_recordings_nothing_is_proved_and_the_summary_says_so() -> None:
    found = finding({"gain.part": 0.02}, prove=False)
    assert found.proof is None
    assert "nothing proves it" in found.summary


def test_a_held_out_copy_of_what_is_fitted_proves_nothing() -> None:
    fitted = recorded({**NOMINAL, "gain.part": 0.02}, noise=5e-4)
    found = diagnosed(fitted, (replace(fitted[2], name="copy"),))
    assert found.proof is None
    assert any("copy is held out and has the very values of" in remark for remark in found.remarks)


def test_a_marker_that_stands_still_is_left_out_and_told() -> None:
    """What it would show is no missing physics."""
    fitted = recorded({**NOMINAL, "friction.torque": 2e-3}, noise=5e-4)
    stuck = []
    for one in fitted:
        values = one.values.copy()
        values[:, 3:6] = [0.0, 0.17, 0.01]
        stuck.append(replace(one, values=values))
    found = diagnosed(tuple(stuck))
    assert found.named == ("friction",)
    assert any("the recorded place of middle never changes" in remark for remark in found.remarks)


def test_an_adequate_model_has_no_place_of_its_misfit() -> None:
    assert finding({}).where is None


def test_a_suspect_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown suspect 'ghost'"):
        finding({}, spec=DiagnosisSpec(suspects=("ghost",)))


def test_only_the_suspects_that_are_asked_for_are_tried() -> None:
    found = finding({"gain.part": 0.02}, spec=DiagnosisSpec(suspects=("delay", "cubic")))
    assert {name for h in found.hypotheses for name in h.effects} <= {"delay", "cubic"}
    assert found.verdict == "unnamed"
