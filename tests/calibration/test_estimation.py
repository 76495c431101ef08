from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibration.estimation import compare_forces, predict, summarise_forces
from calibration.force_result import ForceResult
from calibration.search import CalibrationSpec, calibrate
from records import Dataset
from sim.balance import DRAG, EXAMPLE, HELD_OUT, TRIALS, campaign, true_beat
from workers import make_evaluator

LOCAL = CalibrationSpec(mode="local")
JOINT = CalibrationSpec(mode="joint")


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    return campaign(1, EXAMPLE, held_out=HELD_OUT)


def run(spec: CalibrationSpec, dataset: Dataset) -> tuple[dict[str, Any], ForceResult]:
    evaluator = make_evaluator("in_process")
    *_, last = calibrate(spec, dataset, evaluator)
    return last.checkpoint, summarise_forces(spec, dataset, evaluator, last.checkpoint)


@pytest.fixture(scope="module")
def local(dataset: Dataset) -> ForceResult:
    return run(LOCAL, dataset)[1]


def test_each_recording_has_its_estimate_with_its_error(local: ForceResult) -> None:
    assert [e.name for e in local.estimates] == [t.name for t in TRIALS if t.name not in HELD_OUT]
    true = {trial.name: trial.coefficients for trial in TRIALS}
    off = [
        (e.values[name] - true[e.name][name]) / e.standard_errors[name] for e in local.estimates for name in e.values
    ]
    assert all(e.converged for e in local.estimates)
    assert np.sqrt(np.mean(np.square(off))) < 3
    assert all(np.allclose(np.diag(e.correlation), 1) for e in local.estimates)
    assert all(0 < e.noise[0][0][0] < 0.02**2 for e in local.estimates)


def test_before_and_after(local: ForceResult, dataset: Dataset) -> None:
    scatter = 0.012  # N: what the balance leaves
    assert local.before > 0.03 > scatter > local.after
    assert local.held_out_before is not None
    assert local.held_out_after is not None
    assert local.held_out_before > 0.03 > scatter > local.held_out_after
    assert run(LOCAL, replace(dataset, held_out=()))[1].held_out_after is None


def test_sources_of_each_recording(local: ForceResult) -> None:
    for trial in TRIALS:
        sources = {a.source for a in local.agreements if a.recording == trial.name}
        own = set() if trial.name in HELD_OUT else {"local"}
        assert sources == {"nominal", "global", "average"} | own
    quantities = [a.quantity for a in local.agreements if a.recording == "test-1" and a.source == "local"]
    assert sorted(quantities) == ["drag", "lift", "x", "z"]


def test_global_model_predicts_what_it_has_not_seen(local: ForceResult) -> None:
    assert local.global_model is not None
    assert local.global_model.recordings == tuple(e.name for e in local.estimates)
    lift = {(a.recording, a.source): a for a in local.agreements if a.quantity == "lift"}
    for name in HELD_OUT:
        assert lift[name, "global"].rmse_percent < 5 < lift[name, "nominal"].rmse_percent
    unseen = {a.recording: a for a in local.left_out if a.quantity == "lift"}
    assert set(unseen) == {e.name for e in local.estimates}
    assert np.mean([a.rmse for a in unseen.values()]) > np.mean([lift[name, "global"].rmse for name in unseen])


def test_genes_carry_the_mean_and_the_largest_error(local: ForceResult) -> None:
    genes = {gene.name: gene for gene in local.genes}
    assert genes["C_l"].best == pytest.approx(np.mean([e.values["C_l"] for e in local.estimates]))
    errors = [e.standard_errors["C_F"] / e.values["C_F"] for e in local.estimates]
    assert genes["C_F"].standard_error == pytest.approx(max(errors))
    assert genes["C_l"].identifiable
    assert not genes["C_D0"].searched
    assert genes["C_D0"].standard_error is None


def test_joint_has_one_estimate_for_all(dataset: Dataset) -> None:
    _, result = run(JOINT, dataset)
    assert [e.name for e in result.estimates] == ["joint"]
    assert result.global_model is None
    assert {a.source for a in result.agreements} == {"nominal", "joint"}
    assert result.held_out_after is not None
    assert result.before > result.after


def test_without_enough_conditions_there_is_no_law_and_it_is_said(dataset: Dataset) -> None:
    _, result = run(replace(LOCAL, recordings=("test-1", "test-5", "test-8")), dataset)
    assert result.global_model is None
    assert result.left_out == ()
    assert result.remarks[0].startswith("no global model: a law in flap frequency and body pitch needs at least 4")
    held_out = [a for a in result.agreements if a.recording == "test-3"]
    assert {a.source for a in held_out} == {"nominal", "average"}


def test_extrapolated_recordings_are_named(dataset: Dataset) -> None:
    _, result = run(LOCAL, replace(dataset, held_out=("test-8",)))
    assert any(
        r.startswith("recording 'test-8': flap frequency 10.3 Hz is outside [11.7, 13.3]") for r in result.remarks
    )


def test_comparison_filters_both_alike(dataset: Dataset) -> None:
    true = TRIALS[3].coefficients | DRAG
    checkpoint, _ = run(replace(LOCAL, recordings=("test-4",)), dataset)
    genome = checkpoint["found"]["test-4"] | true
    found = compare_forces(LOCAL, dataset, "test-4", "local", genome)
    above = found.frequency > 120
    assert found.modelled_spectrum["x"][above].max() < 1e-6 * found.modelled_spectrum["x"].max()
    assert found.recorded_spectrum["x"][above].max() < 1e-4 * found.recorded_spectrum["x"].max()
    np.testing.assert_allclose(found.modelled["x"], found.recorded["x"], atol=0.01)
    raw = compare_forces(replace(LOCAL, low_pass=0.0), dataset, "test-4", "local", genome)
    assert np.ptp(raw.modelled["x"]) > 1.05 * np.ptp(found.modelled["x"])


def test_prediction_of_a_condition(local: ForceResult, dataset: Dataset) -> None:
    assert local.global_model is not None
    trial = TRIALS[2]
    found = predict(LOCAL, dataset, local.global_model, trial.condition, points=100)
    true = true_beat(dataset.vehicle, trial)[:, 0]
    assert found.remarks == ()
    assert found.forces["x"].mean() == pytest.approx(true.mean(), rel=0.03)
    assert np.corrcoef(found.forces["x"], true[::16])[0, 1] > 0.98
    far = replace(trial.condition, flap_frequency=20.0)
    beyond = predict(LOCAL, dataset, local.global_model, far)
    assert beyond.values["C_l"] == 0.0
    assert any("flap frequency 20 Hz is outside" in remark for remark in beyond.remarks)
    assert any("gives C_l = -" in remark and "0 is taken" in remark for remark in beyond.remarks)
