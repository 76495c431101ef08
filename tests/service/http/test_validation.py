"""Invalid specifications and simulations are refused with place, value and remedy."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.service.conftest import Api
from wingfit.service.runs import views


@pytest.mark.parametrize(
    ("body", "where"),
    [
        ({"population": 3}, "body.population"),
        ({"population": 1001}, "body.population"),
        ({"population": True}, "body.population"),
        ({"population": "50"}, "body.population"),
        ({"stall": 0}, "body.stall"),
        ({"stall": 1001}, "body.stall"),
        ({"max_generations": 0}, "body.max_generations"),
        ({"max_generations": 10001}, "body.max_generations"),
        ({"seed": -1}, "body.seed"),
        ({"seed": 2**53}, "body.seed"),
        ({"bounds_factor": 1.0}, "body.bounds_factor"),
        ({"bounds_factor": 101}, "body.bounds_factor"),
        ({"accuracy_mm": 0.01}, "body.accuracy_mm"),
        ({"accuracy_mm": None}, "body.accuracy_mm"),
        ({"accuracy_mm": "0.1"}, "body.accuracy_mm"),
        ({"accuracy_mm": True}, "body.accuracy_mm"),
        ({"tolerance": -0.1}, "body.tolerance"),
        ({"tolerance": 1.1}, "body.tolerance"),
        ({"division": "eleven"}, "body.division"),
        ({"division": "3,,2"}, "body.division"),
        ({"division": "0,1"}, "body.division"),
        ({"division": "99"}, "body.division"),
        ({"mode": "both"}, "body.mode"),
        ({"name": ""}, "body.name"),
        ({"name": "  "}, "body.name"),
        ({"name": "\u200b"}, "body.name"),
        ({"name": "two\nlines"}, "body.name"),
        ({"name": "\x1b[31mred"}, "body.name"),
        ({"name": "turned \u202earound"}, "body.name"),
        ({"dataset_id": "ds_0"}, "body.dataset_id"),
        ({"generations": 5}, "body.generations"),
        ({"recordings": ["slow", "nope"]}, "body.recordings.1"),
        ({"genes": ["nope"]}, "body.genes.0"),
        ({"recordings": ["unseen"]}, "body"),
    ],
)
def test_a_specification_that_does_not_fit_is_refused(
    shared: tuple[Api, str], body: dict[str, Any], where: str
) -> None:
    api, dataset = shared
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset} | body)
    assert answer.status_code == 422, answer.text
    assert [error["where"] for error in answer.json()["errors"]] == [where]
    told = api.client.post("/v1/runs?validate_only=true", json={"dataset_id": dataset} | body)
    assert (told.status_code, told.json()) == (422, answer.json())
    assert api.get("/v1/runs")["items"] == []


@pytest.mark.parametrize("path", ["runs", "runs?validate_only=true", "diagnoses"])
def test_a_lone_surrogate_in_a_name_is_refused(api: Api, path: str) -> None:
    text = json.dumps({"dataset_id": api.upload()["id"], "name": "half \ud83e"})
    answer = api.client.post(f"/v1/{path}", content=text, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["errors"][0]["where"]) == (422, "body.name")
    whole = api.client.post(f"/v1/{path}", json=json.loads(text) | {"name": "whole \U0001f99a"})
    assert (whole.status_code in (200, 202), whole.json()["name"]) == (True, "whole \U0001f99a")


def test_a_specification_is_checked_without_a_run(api: Api) -> None:
    body = {"dataset_id": api.upload()["id"], "seed": 5}
    answer = api.client.post("/v1/runs?validate_only=true", json=body)
    assert answer.status_code == 200
    assert api.get("/v1/runs")["items"] == []
    run = api.submit(**body, max_generations=answer.json()["spec"]["max_generations"])
    assert answer.json() == {"name": run["name"], "spec": run["spec"]}


@pytest.mark.parametrize("division", ["eleven", "128x1", "4 ", "", "4\n", ",".join(["1"] * 65), "1," * 150 + "1"])
@pytest.mark.parametrize("route", ["runs", "simulations", "loads"])
def test_an_invalid_discretisation_is_refused_with_an_example(
    shared: tuple[Api, str], route: str, division: str
) -> None:
    api, _ = shared
    answer = api.client.post(f"/v1/{route}", json={"dataset_id": "x", "recording": "slow", "division": division})
    (said,) = [error["message"] for error in answer.json()["errors"] if error["where"] == "body.division"]
    assert "preset 4, 11, 24; strips x bodies of each: 6x4" in said


def test_an_unknown_name_lists_the_known_ones(api: Api) -> None:
    body = {"dataset_id": api.upload()["id"], "genes": ["stifness"], "recordings": ["slo"]}
    errors = api.client.post("/v1/runs", json=body).json()["errors"]
    assert "stiffness, damping" in errors[1]["message"]
    assert "slow, fast, unseen" in errors[0]["message"]
    assert errors[1]["value"] == "stifness"


def test_known_names_are_listed_once(api: Api) -> None:
    body = {"dataset_id": api.upload()["id"], "recordings": [f"r{k}" for k in range(1000)]}
    answer = api.client.post("/v1/runs", json=body)
    errors = answer.json()["errors"]
    assert len(errors) == 1000
    assert [error["message"].count("slow") for error in errors] == [1] + [0] * 999


@pytest.mark.parametrize("text", ["", "{", "[]", '{"dataset_id": "\\ud800"}', '{"dataset_id": "x", "tolerance": NaN}'])
def test_a_body_that_is_no_json_object_is_a_problem(shared: tuple[Api, str], text: str) -> None:
    api, _ = shared
    answer = api.client.post("/v1/runs", content=text, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.headers["Content-Type"]) == (422, "application/problem+json")
    assert answer.json()["errors"]


def test_a_simulation(api: Api) -> None:
    dataset = api.upload()["id"]
    body: dict[str, Any] = {"dataset_id": dataset, "recording": "fast", "genome": {"stiffness": 2.0}}
    answer = api.client.post("/v1/simulations", json=body)
    assert answer.status_code == 200, answer.text
    tracks = answer.json()
    assert tracks["recording"] == "fast"
    assert tracks["recorded_mm"][1][1] == [None, None, None]
    # 1e-3 (1^2 + 0.1^2) m along every axis
    assert tracks["mean_distance_mm"] == pytest.approx(1.01 * 3**0.5)
    nominal = api.client.post("/v1/simulations", json=body | {"genome": {}}).json()
    assert nominal["mean_distance_mm"] > tracks["mean_distance_mm"]


def test_a_long_recording_is_thinned_out(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    body: dict[str, Any] = {"dataset_id": api.upload()["id"], "recording": "fast"}
    whole = api.client.post("/v1/simulations", json=body).json()
    assert (whole["stride"], len(whole["phase"])) == (1, 4)
    monkeypatch.setattr(views, "MOST_COORDINATES", 4 * 6 // 2)
    thinned = api.client.post("/v1/simulations", json=body).json()
    assert thinned["stride"] == 2
    for name in ("phase", "recorded_mm", "simulated_mm"):
        assert thinned[name] == whole[name][::2]
    assert thinned["mean_distance_mm"] == whole["mean_distance_mm"]


@pytest.mark.parametrize(
    ("body", "status", "where"),
    [
        ({"genome": {"stiffness": 11.0}}, 422, "body.genome"),
        ({"genome": {"stifness": 1.0}}, 422, "body.genome"),
        ({"genome": {"stiffness": True}}, 422, "body.genome.stiffness"),
        ({"recording": "nope"}, 422, "body.recording"),
        ({"division": "99"}, 422, "body.division"),
        ({"genome": {"stiffness": 9.5}}, 409, None),
    ],
)
def test_an_invalid_simulation_is_refused(
    shared: tuple[Api, str], body: dict[str, Any], status: int, where: str | None
) -> None:
    api, dataset = shared
    complete = {"dataset_id": dataset, "recording": "slow"} | body
    answer = api.client.post("/v1/simulations", json=complete)
    assert answer.status_code == status, answer.text
    assert ([e["where"] for e in answer.json().get("errors", ())] or [None]) == [where]
