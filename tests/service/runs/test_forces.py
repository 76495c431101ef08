"""Runs on forces over HTTP, with the real engine: submitted, followed, judged, predicted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.service.conftest import Api
from tests.service.runs import force_data
from tests.service.runs.force_data import TRUTH, finished, served, upload
from tests.service.shapes import fields, valid
from wingfit.client.answers import Dataset, Run
from wingfit.client.force_answers import (
    ForceResult,
    Forces,
    Prediction,
    Quantity,
    Source,
)
from wingfit.records import Recording
from wingfit.sim.vehicle.lift_drag import lift_drag
from wingfit.sim.virtual_rigs.balance import TRIALS

Json = dict[str, Any]
PITCH = {trial.name: trial.condition.angle_of_attack for trial in TRIALS}


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    yield from served(tmp_path_factory.mktemp("forces"))


@pytest.fixture(scope="module")
def dataset(api: Api) -> Json:
    return upload(api, force_data.archive())


@pytest.fixture(scope="module")
def local(api: Api, dataset: Json) -> Json:
    return finished(api, dataset)


@pytest.fixture(scope="module")
def joint(api: Api, dataset: Json) -> Json:
    return finished(api, dataset, mode="joint")


@pytest.fixture(scope="module")
def result(api: Api, local: Json) -> Json:
    return api.get(f"/v1/runs/{local['id']}/result")


def test_a_dataset_of_forces_is_described(dataset: Json) -> None:
    shown = valid(Dataset, dataset)
    assert (shown.kind, shown.markers) == ("forces", 0)
    first = shown.recordings[0]
    assert (first.markers, first.channels, first.missing_percent) == (0, ["force_x", "force_z"], 0.0)
    assert [first.flap_frequency_hz, first.angle_of_attack_deg] == pytest.approx([12.5, 70.0])
    assert [r.held_out for r in shown.recordings] == [r.name == force_data.HELD_OUT for r in shown.recordings]


def test_what_is_left_open_is_decided_and_shown(api: Api, local: Json) -> None:
    run = valid(Run, local)
    assert (run.kind, run.best_mm, run.name) == ("forces", None, "delfly, proposed, local")
    spec = run.spec
    assert (spec.mode, spec.method, spec.preset, spec.axes) == ("local", "gauss_newton", "proposed", ["x"])
    assert (spec.low_pass_hz, spec.finish, spec.without, spec.peel_width_beats) == (None, False, [], 0.0)
    history = api.history(local["id"])
    assert {item["stage"] for item in history} == {f"{name}, Gauss-Newton" for name in force_data.FITTED}
    assert all(item["best_mm"] is None and item["best_mn"] > 0 for item in history)
    assert history[-1]["evaluations"] == local["evaluations"]


def test_the_result_has_the_coefficients_that_were_put_in(local: Json, result: Json) -> None:
    found = valid(ForceResult, result)
    assert result["after_mn"] == local["best_mn"]
    assert result["after_mn"] < 0.3 * result["before_mn"]
    assert result["held_out_after_mn"] < 0.5 * result["held_out_before_mn"]
    assert [e.name for e in found.estimates] == list(force_data.FITTED)
    for estimate in found.estimates:
        assert estimate.recordings == [estimate.name]
        assert [len(row) for row in estimate.correlation] == [3, 3, 3]
        assert [[len(row) for row in matrix] for matrix in estimate.noise_mn2] == [[1]]
        assert estimate.converged
        for c in estimate.coefficients:
            assert c.value == pytest.approx(TRUTH[estimate.name][c.name], rel=0.06)
            assert c.standard_error is not None
            assert c.low_90 is not None
            assert c.high_90 is not None
            assert (c.high_90 - c.low_90) / c.standard_error == pytest.approx(2 * 1.645, rel=1e-3)
            assert c.low_90 < c.value < c.high_90
    # R in mN^2: its root is the RMS difference of the fitted axis
    noise = [estimate["noise_mn2"][0][0][0] for estimate in result["estimates"]]
    assert float(np.sqrt(np.mean(noise))) == pytest.approx(result["after_mn"], rel=0.2)


def test_the_result_compares_every_recording_with_every_model(result: Json) -> None:
    keys = {(a["recording"], a["source"], a["quantity"]) for a in result["agreements"]}
    every = ("nominal", "global", "average")
    quantities = ("lift", "drag", "x", "z")
    expected = {(name, source, q) for name in force_data.FITTED for source in (*every, "local") for q in quantities}
    assert keys == expected | {(force_data.HELD_OUT, source, q) for source in every for q in quantities}
    assert {a["source"] for a in result["leave_one_out"]} == {"global"}
    x = {(a["recording"], a["source"]): a for a in result["agreements"] if a["quantity"] == "x"}
    for name in force_data.FITTED:
        assert x[name, "local"]["rmse_n"] < x[name, "average"]["rmse_n"]
        assert x[name, "local"]["correlation"] > 0.95
        assert 0 < x[name, "local"]["rmse_percent"] < 10


def test_the_global_model_is_in_hertz_and_degrees(result: Json) -> None:
    law = result["global_model"]
    assert law["recordings"] == list(force_data.FITTED)
    assert law["frequency_range_hz"] == [10.3, 13.3]
    assert law["pitch_range_deg"] == pytest.approx([31.0, 71.0])
    assert law["airspeed_range_m_s"] == [0.55, 2.0]
    genes = {gene["name"]: gene for gene in law["genes"]}
    assert set(genes) == {"C_l", "C_r", "C_F"}
    assert (genes["C_r"]["per_hz"], genes["C_r"]["per_deg"]) == (0.0, 0.0)
    c = genes["C_F"]
    for estimate in result["estimates"]:
        condition = next(t.condition for t in TRIALS if t.name == estimate["name"])
        law_says = (
            c["constant"]
            + c["per_hz"] * condition.flap_frequency
            + c["per_deg"] * np.degrees(condition.angle_of_attack)
        )
        value = next(k["value"] for k in estimate["coefficients"] if k["name"] == "C_F")
        assert abs(law_says / value - 1) <= c["largest_error_percent"] / 100 * (1 + 1e-9)


@pytest.mark.parametrize("source", ["local", "global", "average", "nominal"])
def test_forces_over_the_beat_agree_as_the_result_says(api: Api, local: Json, result: Json, source: Source) -> None:
    name = "test-4"
    answer = api.get(f"/v1/runs/{local['id']}/forces?recording={name}&source={source}")
    shown = valid(Forces, answer)
    assert set(answer) == fields(Forces)
    assert (shown.recording, shown.source) == (name, source)
    n = len(shown.phase)
    assert [shown.phase[0], shown.phase[-1]] == pytest.approx([0.0, 1 - 1 / n])
    for series in (shown.recorded_n, shown.standard_deviation_n, shown.modelled_n):
        assert {q: len(values) for q, values in series.items()} == dict.fromkeys(("lift", "drag", "x", "z"), n)
    assert len(shown.frequency_hz) == len(shown.recorded_spectrum_n2_hz["x"]) == len(shown.modelled_spectrum_n2_hz["x"])
    said = {a["quantity"]: a for a in result["agreements"] if (a["recording"], a["source"]) == (name, source)}
    quantities: tuple[Quantity, ...] = ("lift", "drag", "x", "z")
    for q in quantities:
        assert np.mean(shown.recorded_n[q]) == pytest.approx(said[q]["mean_recorded_n"], abs=1e-7)
        assert np.mean(shown.modelled_n[q]) == pytest.approx(said[q]["mean_modelled_n"], abs=1e-7)
    both = lift_drag(np.stack([shown.modelled_n["x"], shown.modelled_n["z"]], axis=1), PITCH[name])
    np.testing.assert_allclose(both[:, 0], shown.modelled_n["lift"], atol=1e-6)
    np.testing.assert_allclose(both[:, 1], shown.modelled_n["drag"], atol=1e-6)


def test_the_source_that_is_shown_unasked(api: Api, local: Json, joint: Json) -> None:
    def source(run: Json, query: str) -> str:
        return str(api.get(f"/v1/runs/{run['id']}/forces{query}")["source"])

    assert source(local, "") == "local"
    assert source(local, f"?recording={force_data.HELD_OUT}") == "global"
    assert source(joint, f"?recording={force_data.HELD_OUT}") == "joint"


@pytest.mark.parametrize(
    ("mode", "query", "said"),
    [
        ("local", "?source=joint", "has no joint coefficients for recording 'test-3'; it has: local, global, average"),
        ("local", f"?source=local&recording={force_data.HELD_OUT}", "has no local coefficients for recording 'test-7'"),
        ("joint", "?source=local", "it has: joint, nominal"),
    ],
)
def test_a_source_that_a_run_does_not_have(
    api: Api, local: Json, joint: Json, mode: str, query: str, said: str
) -> None:
    run = {"local": local, "joint": joint}[mode]
    answer = api.client.get(f"/v1/runs/{run['id']}/forces{query}")
    assert answer.status_code == 409
    assert said in answer.json()["detail"]


def test_what_belongs_to_tracks_is_refused_with_where_to_go(api: Api, local: Json, dataset: Json) -> None:
    for path in ("comparison", "loads"):
        answer = api.client.get(f"/v1/runs/{local['id']}/{path}")
        assert answer.status_code == 409
        assert f"/v1/runs/{local['id']}/forces" in answer.json()["detail"]
    answer = api.client.post("/v1/loads", json={"dataset_id": dataset["id"], "recording": "test-4"})
    assert (answer.status_code, answer.json()["errors"][0]["where"]) == (422, "body.dataset_id")


def test_the_genome_of_a_local_run_is_the_average(api: Api, local: Json, result: Json) -> None:
    genome = api.get(f"/v1/runs/{local['id']}/genome")
    assert genome == {"genes": result["genes"], "final": True}
    c_l = next(gene for gene in genome["genes"] if gene["name"] == "C_l")
    values = [k["value"] for e in result["estimates"] for k in e["coefficients"] if k["name"] == "C_l"]
    assert c_l["best"] == pytest.approx(np.mean(values))
    assert [gene["name"] for gene in genome["genes"] if gene["searched"]] == ["C_l", "C_r", "C_F"]


def test_a_prediction_at_a_fitted_condition_is_the_global_model(api: Api, local: Json, result: Json) -> None:
    trial = next(t for t in TRIALS if t.name == "test-4")
    body = {"flap_frequency_hz": 12.5, "body_pitch_deg": 71.0, "airspeed_m_s": trial.condition.airspeed}
    answer = api.client.post(f"/v1/runs/{local['id']}/predictions", json=body)
    assert answer.status_code == 200, answer.text
    found = valid(Prediction, answer.json())
    assert set(answer.json()) == fields(Prediction)
    assert found.warnings == []
    lengths = {len(s) for s in (found.phase, found.x_n, found.z_n, found.lift_n, found.drag_n)}
    assert len(lengths) == 1
    assert found.averages_n.lift == pytest.approx(np.mean(found.lift_n), abs=1e-7)
    said = next(
        a for a in result["agreements"] if (a["recording"], a["source"], a["quantity"]) == ("test-4", "global", "lift")
    )
    assert found.averages_n.lift == pytest.approx(said["mean_modelled_n"], rel=0.01)
    genes = {gene["name"]: gene for gene in result["global_model"]["genes"]}
    for name, value in found.coefficients.items():
        gene = genes[name]
        assert value == pytest.approx(gene["constant"] + 12.5 * gene["per_hz"] + 71.0 * gene["per_deg"])


def test_a_prediction_far_away_warns_and_without_a_law_is_refused(api: Api, local: Json, joint: Json) -> None:
    path, body = f"/v1/runs/{local['id']}/predictions", {"flap_frequency_hz": 13.8, "body_pitch_deg": 72.0}
    found = api.client.post(path, json=body | {"airspeed_m_s": 0.3})
    assert found.status_code == 200, found.text
    assert "is outside [10.3, 13.3] Hz" in found.json()["warnings"][0]
    windy = api.client.post(path, json={"flap_frequency_hz": 12.5, "body_pitch_deg": 70.0, "airspeed_m_s": 30.0})
    assert windy.json()["warnings"] == [
        "airspeed 30 m/s is outside [0.55, 2] m/s, where the coefficients were fitted: an extrapolation"
    ]
    beyond = api.client.post(path, json={"flap_frequency_hz": 50.0, "body_pitch_deg": 0.0, "airspeed_m_s": 0.0}).json()
    assert any("too far from those fitted to be believed" in warning for warning in beyond["warnings"])
    assert all(0 <= value <= 8 for value in beyond["coefficients"].values())
    none = api.client.post(f"/v1/runs/{joint['id']}/predictions", json=body | {"airspeed_m_s": 0.3})
    assert (none.status_code, "only mode 'local'" in none.json()["detail"]) == (409, True)


@pytest.mark.parametrize(
    ("body", "where"),
    [
        ({"flap_frequency_hz": 0.0}, "body.flap_frequency_hz"),
        ({"body_pitch_deg": 91.0}, "body.body_pitch_deg"),
        ({"airspeed_m_s": None}, "body.airspeed_m_s"),
        ({"temperature_c": 300.0}, "body.temperature_c"),
        ({"phase_lag_deg": 0.0}, "body.phase_lag_deg"),
    ],
)
def test_a_prediction_that_cannot_be_meant(api: Api, local: Json, body: Json, where: str) -> None:
    complete: Json = {"flap_frequency_hz": 12.5, "body_pitch_deg": 71.0, "airspeed_m_s": 0.65} | body
    answer = api.client.post(f"/v1/runs/{local['id']}/predictions", json=complete)
    assert (answer.status_code, [e["where"] for e in answer.json()["errors"]]) == (422, [where])


def test_too_few_conditions_give_no_global_model_and_say_why(api: Api) -> None:
    run = finished(api, upload(api, force_data.archive(3)))
    result = api.get(f"/v1/runs/{run['id']}/result")
    assert result["global_model"] is None
    assert result["leave_one_out"] == []
    body = {"flap_frequency_hz": 12.5, "body_pitch_deg": 71.0, "airspeed_m_s": 0.65}
    answer = api.client.post(f"/v1/runs/{run['id']}/predictions", json=body)
    assert answer.status_code == 409
    assert "at least 4 conditions, got 2" in answer.json()["detail"]
    assert api.get(f"/v1/runs/{run['id']}/forces?recording={force_data.HELD_OUT}")["source"] == "average"


def test_a_force_that_is_constant_has_no_percentage(api: Api) -> None:
    def without_z(recording: Recording) -> Recording:
        return replace(recording, values=recording.values * [1.0, 0.0])

    given = force_data.dataset()
    flat = replace(given, recordings=tuple(without_z(r) for r in given.recordings))
    run = finished(api, upload(api, force_data.zipped(flat)))
    found = valid(ForceResult, api.get(f"/v1/runs/{run['id']}/result"))
    for a in (*found.agreements, *found.leave_one_out):
        assert ((a.rmse_percent, a.correlation) == (None, None)) is (a.quantity == "z")
        assert a.rmse_n is not None
    shown = valid(Forces, api.get(f"/v1/runs/{run['id']}/forces"))
    assert set(shown.recorded_n["z"]) == {0.0}
