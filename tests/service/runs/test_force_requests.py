"""Requests about forces over HTTP, with the real engine: simulations, models, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from tests.service import toy
from tests.service.conftest import Api, serving
from tests.service.runs import force_data
from tests.service.runs.force_data import TRUTH, finished, served, upload
from tests.service.shapes import valid
from wingfit.calibration.search import CalibrationSpec, resolved
from wingfit.client.force_answers import ForceSimulation, Models
from wingfit.client.planning.answers import Plan
from wingfit.planning import PlanSpec
from wingfit.records import LowPass, Recording
from wingfit.service.app import create_app
from wingfit.service.http.problems import ProblemError
from wingfit.service.planning.routes import planned
from wingfit.service.runs.requests import Preset
from wingfit.service.runs.spec_views import run_name
from wingfit.service.settings import Settings
from wingfit.sim.vehicle.terms import PRESETS, TERMS

Json = dict[str, Any]


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    yield from served(tmp_path_factory.mktemp("forces"))


@pytest.fixture(scope="module")
def dataset(api: Api) -> Json:
    return upload(api, force_data.archive())


def test_a_recording_without_a_whole_beat_is_refused_when_it_is_submitted(api: Api) -> None:
    def broken(recording: Recording) -> Recording:
        values = recording.values.copy()
        values[20::60] = np.nan
        return replace(recording, values=values, low_pass=LowPass(40.0))

    given = force_data.dataset()
    recordings = tuple(broken(r) if r.name == force_data.HELD_OUT else r for r in given.recordings)
    dataset = upload(api, force_data.zipped(replace(given, recordings=recordings)))
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset["id"]})
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert "recording 'test-7' holds no whole beat without a gap: each of its 4 whole beats" in error["message"]


def test_a_simulation_of_a_genome_of_ones_own(api: Api, dataset: Json) -> None:
    body: Json = {"dataset_id": dataset["id"], "recording": "test-4", "genome": TRUTH["test-4"]}
    answer = api.client.post("/v1/simulations", json=body)
    assert answer.status_code == 200, answer.text
    true = valid(ForceSimulation, answer.json())
    assert {(a.quantity, a.source) for a in true.agreements} == {(q, "given") for q in ("lift", "drag", "x", "z")}
    x = next(a for a in true.agreements if a.quantity == "x")
    assert x.correlation is not None
    assert x.correlation > 0.98
    other = api.client.post("/v1/simulations", json=body | {"preset": "berman_wang", "genome": {}}).json()
    assert next(a["rmse_n"] for a in other["agreements"] if a["quantity"] == "x") > 2 * (x.rmse_n or 1)
    raw = api.client.post("/v1/simulations", json=body | {"low_pass_hz": 0}).json()
    assert np.ptp(raw["modelled_n"]["x"]) > np.ptp(true.modelled_n["x"])


@pytest.mark.parametrize(
    ("body", "where"),
    [
        ({"genome": {"C_l": 6.0}}, "body.genome"),
        ({"genome": {"C_x": 1.0}}, "body.genome"),
        ({"preset": "berman_wang", "genome": {"C_F": 1.0}}, "body.genome"),
        ({"without": ["fling"]}, "body.without"),
        ({"division": "4"}, "body.division"),
        ({"low_pass_hz": 12.4}, "body.low_pass_hz"),
        ({"outputs": True}, "body.outputs"),
        ({"peel_width_beats": 0.6}, "body.peel_width_beats"),
    ],
)
def test_a_simulation_that_cannot_be_meant(api: Api, dataset: Json, body: Json, where: str) -> None:
    complete: Json = {"dataset_id": dataset["id"], "recording": "test-4"} | body
    answer = api.client.post("/v1/simulations", json=complete)
    assert (answer.status_code, [e["where"] for e in answer.json()["errors"]]) == (422, [where])


@pytest.mark.parametrize(
    ("body", "where", "said"),
    [
        ({"mode": "staged"}, "body", "use 'local'"),
        ({"method": "annealing"}, "body.method", "'genetic', 'cma_es', 'gauss_newton' or 'auto'"),
        ({"preset": "blade"}, "body.preset", "'proposed', 'berman_wang' or 'dickinson'"),
        ({"without": ["fling"]}, "body.without", "has no term 'fling' to leave out; it has inertial, translation"),
        ({"axes": ["y"]}, "body.axes.0", "'x' or 'z'"),
        ({"axes": []}, "body.axes", "at least 1"),
        ({"axes": ["x", "x"]}, "body.axes", "once"),
        ({"low_pass_hz": 700}, "body", "a low-pass at 700 Hz does not fit recording 'test-3', sampled at 1250 Hz"),
        ({"low_pass_hz": 13}, "body.low_pass_hz", "flap frequency of recording 'test-6', 13.3 Hz"),
        ({"low_pass_hz": -1}, "body.low_pass_hz", "greater than or equal to 0"),
        ({"peel_width_beats": 0.6}, "body.peel_width_beats", "less than or equal to 0.5"),
        ({"genes": ["E_f"]}, "body.genes.0", "known are C_l, C_r, C_F, C_D0"),
        ({"preset": "berman_wang", "genes": ["C_F"]}, "body.genes.0", "known are C_l, C_r, C_D0"),
        ({"division": "4"}, "body.division", "means nothing for a vehicle"),
        ({"search_division": "4", "method": "auto"}, "body.search_division", "means nothing for a vehicle"),
        ({"accuracy_mm": 0.2}, "body.accuracy_mm", "means nothing for a vehicle"),
        ({"finish": 1}, "body.finish", "boolean"),
        ({"finish": True}, "body.finish", "gauss_newton, which searches nothing"),
        ({"method": "gauss_newton", "population": 20}, "body.population", "leave it out, or use genetic or cma_es"),
        ({"stall": 3}, "body.stall", "searches nothing"),
        ({"method": "auto", "finish": True}, "body.finish", "auto, which ends with Gauss-Newton in any case; leave it"),
    ],
)
def test_a_specification_that_does_not_fit_is_refused(
    api: Api, dataset: Json, body: Json, where: str, said: str
) -> None:
    before = len(api.get("/v1/runs")["items"])
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset["id"]} | body)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["where"] == where
    assert said in error["message"]
    assert len(api.get("/v1/runs")["items"]) == before


def test_a_search_followed_by_gauss_newton(api: Api, dataset: Json) -> None:
    options: Json = {"method": "cma_es", "finish": True, "population": 6, "max_generations": 5, "genes": ["C_l", "C_F"]}
    run = finished(api, dataset, recordings=["test-4"], axes=["x", "z"], low_pass_hz=40, **options)
    assert run["name"] == "delfly, proposed, local, CMA-ES finished by Gauss-Newton"
    assert [item["stage"] for item in api.history(run["id"])][:6] == ["test-4"] * 5 + ["test-4, Gauss-Newton"]
    (estimate,) = api.get(f"/v1/runs/{run['id']}/result")["estimates"]
    assert [c["name"] for c in estimate["coefficients"]] == ["C_l", "C_F"]
    assert np.shape(estimate["noise_mn2"]) == (1, 2, 2)


def test_gauss_newton_from_several_starts(api: Api, dataset: Json) -> None:
    options: Json = {"method": "auto", "population": 6, "stall": 9, "tolerance": 0.01, "seed": 2, "max_generations": 3}
    run = finished(api, dataset, recordings=["test-4"], genes=["C_l", "C_F"], finish=False, **options)
    assert run["name"] == "delfly, proposed, local, auto"
    assert {name: run["spec"][name] for name in options} == options
    history = api.history(run["id"])
    assert [(item["stage"], item["generation"]) for item in history[:3]] == [("test-4", k) for k in range(3)]
    iterations = history[3:]
    assert {item["stage"] for item in iterations} == {"test-4, Gauss-Newton"}
    assert [item["generation"] for item in iterations] == list(range(len(iterations)))
    (estimate,) = api.get(f"/v1/runs/{run['id']}/result")["estimates"]
    assert [c["name"] for c in estimate["coefficients"]] == ["C_l", "C_F"]
    for coefficient in estimate["coefficients"]:
        truth = TRUTH["test-4"][coefficient["name"]]
        assert coefficient["low_90"] - 0.05 * truth < truth < coefficient["high_90"] + 0.05 * truth


def test_the_models_are_those_of_the_simulator(api: Api) -> None:
    found = valid(Models, api.get("/v1/models"))
    assert [p.name for p in found.presets] == list(PRESETS) == list(Preset.__args__)  # type: ignore[attr-defined]
    assert {t.name: [g.name for g in t.genes] for t in found.terms} == {
        t.name: [g.name for g in t.genes] for t in TERMS.values()
    }
    assert all(t.equation and t.source and t.description for t in found.terms)
    assert all(set(p.terms) <= {t.name for t in found.terms} for p in found.presets)


def test_settings_of_a_vehicle_are_refused_for_a_wing(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path / "data"), engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        tracks = Api(client)
        wing = tracks.upload()
        assert (wing["kind"], wing["recordings"][0]["channels"]) == ("tracks", [])
        body = {"dataset_id": wing["id"], "preset": "dickinson", "axes": ["z"], "low_pass_hz": 40.0}
        answer = client.post("/v1/runs", json=body)
        assert answer.status_code == 422
        assert [e["where"] for e in answer.json()["errors"]] == ["body.preset", "body.axes", "body.low_pass_hz"]
        run = tracks.finish(tracks.submit(wing["id"], axes=["x"], without=[])["id"])
        assert (run["kind"], run["best_mn"], run["spec"]["method"]) == ("tracks", None, "genetic")
        assert tracks.get(f"/v1/runs/{run['id']}/result")["kind"] == "tracks"
        forces = client.get(f"/v1/runs/{run['id']}/forces")
        assert (forces.status_code, "/comparison" in forces.json()["detail"]) == (409, True)
        body = {"flap_frequency_hz": 12.5, "body_pitch_deg": 71.0, "airspeed_m_s": 0.65}
        assert client.post(f"/v1/runs/{run['id']}/predictions", json=body).status_code == 409


@pytest.mark.parametrize(
    ("spec", "name"),
    [
        ({}, "delfly, proposed, local"),
        ({"without": ("clap_and_peel",), "mode": "joint"}, "delfly, proposed without clap_and_peel, joint"),
        ({"preset": "dickinson", "method": "genetic"}, "delfly, dickinson, local, genetic"),
    ],
)
def test_a_run_without_a_name_is_named_after_what_tells_it_from_others(spec: Json, name: str) -> None:
    given = force_data.dataset()
    assert run_name(given, resolved(CalibrationSpec(**spec), given)) == name


def test_an_experiment_is_planned(api: Api, dataset: Json) -> None:
    body: Json = {"suspects": ["stroke_bias", "mass_offset"], "genome": {"C_l": 1.2}, "add": 0, "beats": 20}
    answer = api.client.post(f"/v1/datasets/{dataset['id']}/plan", json=body)
    assert answer.status_code == 200, answer.text
    found = TypeAdapter(Plan).validate_python(answer.json(), strict=True)
    assert [gene["name"] for gene in found["genes"]] == ["C_l", "C_r", "C_F"]
    assert found["genes"][0]["value"] == 1.2
    assert {one["name"] for one in found["effects"]} == {"stroke_bias", "mass_offset"}
    assert found["beats"] == 20
    assert found["for_genes"] == []


@pytest.mark.parametrize(
    ("body", "where", "words"),
    [
        ({"noise_mm": 0.3}, "body.noise_mm", "noise_mm is a setting of marker tracks"),
        ({"suspects": ["backlash"]}, "body.suspects", "unknown suspect 'backlash'"),
        ({"division": "4"}, "body.division", "means nothing for a vehicle"),
        ({"beats": 0}, "body.beats", "greater than or equal to 1"),
        ({"add": 21}, "body.add", "less than or equal to 20"),
        ({"effects": ["nothing"]}, "body.effects.0", "nothing"),
        ({"genome": {"E_f": 1.0}}, "body.genome", "which the model does not have"),
        ({"genome": {"C_l": -1.0}}, "body.genome", "it must lie in"),
        ({"genes": ["E_f"]}, "body.genes", "unknown gene 'E_f'"),
        ({"recordings": ["none"]}, "body.recordings", "no recording 'none'"),
        ({"axes": ["y"]}, "body.axes.0", "should be 'x' or 'z'"),
        ({"without": ["translation", "clap_and_peel", "rotation"]}, "body", "nothing to calibrate"),
    ],
)
def test_plans_that_cannot_be_made_are_refused(api: Api, dataset: Json, body: Json, where: str, words: str) -> None:
    answer = api.client.post(f"/v1/datasets/{dataset['id']}/plan", json={"suspects": None, "add": 0} | body)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["where"] == where
    assert words in f"{error['message']} {error['value']}"


def test_a_plan_ends_within_a_simulation_once_nobody_waits_for_it() -> None:
    looks: list[int] = []

    def gone() -> bool:
        looks.append(len(looks))
        return len(looks) > 5

    with pytest.raises(ProblemError, match="the client has hung up") as raised:
        planned(force_data.dataset(), PlanSpec(), gone)
    assert raised.value.status == 503
    assert len(looks) < 20, "no further simulation starts"


def test_a_plan_of_an_unknown_dataset_is_refused(api: Api) -> None:
    assert api.client.post("/v1/datasets/ds_0/plan", json={}).status_code == 404
