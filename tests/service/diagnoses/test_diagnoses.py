"""Diagnoses over the API: submission, progress, finding, report, cancellation, restart, limits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.service import toy, toy_diagnosis
from tests.service.conftest import Api, Gate, serving
from tests.service.http.test_events import parse
from tests.service.processes import ServerProcess
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

Json = dict[str, Any]
STEPS = toy_diagnosis.STEPS * len(toy_diagnosis.STAGES)


def error(api: Api, status: int = 422, **body: Any) -> Json:
    answer = api.client.post("/v1/diagnoses", json=body)
    assert (answer.status_code, answer.headers["Content-Type"]) == (status, "application/problem+json"), answer.text
    return dict(answer.json())


def test_a_diagnosis_goes_from_queued_to_a_finding_and_a_report(api: Api) -> None:
    dataset = api.upload()["id"]
    answer = api.client.post("/v1/diagnoses", json={"dataset_id": dataset, "division": "4", "seed": 3})
    submitted = answer.json()
    assert answer.status_code == 202
    assert answer.headers["Location"] == f"/v1/diagnoses/{submitted['id']}"
    assert (submitted["state"], submitted["name"], submitted["verdict"]) == ("QUEUED", "toy, division 4", None)
    assert (submitted["spec"]["division"], submitted["spec"]["seed"], submitted["spec"]["start"]) == ("4", 3, {})
    done = api.diagnosed(submitted["id"])
    assert (done["state"], done["progress"], done["verdict"], done["stage"]) == ("SUCCEEDED", 1.0, "named", "done")
    assert (done["steps"], done["evaluations"], done["eta_seconds"]) == (STEPS, 10 * STEPS, None)
    assert done["created_at"] < done["started_at"] < done["finished_at"]
    finding = api.get(f"/v1/diagnoses/{submitted['id']}/finding")
    assert (finding["verdict"], finding["summary"]) == ("named", done["summary"])
    assert api.get("/v1/diagnoses")["items"] == [done]
    assert api.get(f"/v1/diagnoses?dataset_id={dataset}&state=SUCCEEDED")["items"] == [done]
    assert api.get("/v1/diagnoses?state=RUNNING")["items"] == []


def test_the_report_is_a_page_that_may_do_nothing(api: Api) -> None:
    path = f"/v1/diagnoses/{api.diagnosed(api.diagnose(api.upload()['id'])['id'])['id']}/report"
    answer = api.client.get(path)
    assert answer.headers["Content-Type"] == "text/html; charset=utf-8"
    assert "The hinge is off its place" in answer.text
    policy = answer.headers["Content-Security-Policy"].split("; ")
    assert {"default-src 'none'", "style-src 'unsafe-inline'", "frame-ancestors 'self'"} <= set(policy)
    assert not any(part.startswith("script-src") for part in policy)
    assert any(part.startswith("sandbox") and "allow-scripts" not in part for part in policy)
    assert answer.headers["X-Frame-Options"] == "SAMEORIGIN"
    again = api.client.get(path, headers={"If-None-Match": answer.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_same_seed_same_finding_and_another_seed_another(api: Api) -> None:
    dataset = api.upload()["id"]
    ids = [api.diagnosed(api.diagnose(dataset, seed=seed)["id"])["id"] for seed in (4, 4, 5)]
    found = [api.get(f"/v1/diagnoses/{one}/finding") for one in ids]
    assert found[0] == found[1] != found[2]


def test_a_run_gives_its_genome_and_its_settings(api: Api) -> None:
    dataset = api.upload()["id"]
    run = api.submit(dataset, division="24", seed=8, accuracy_mm=0.07, recordings=["fast"])["id"]
    api.finish(run)
    best = {gene["name"]: gene["best"] for gene in api.get(f"/v1/runs/{run}/genome")["genes"]}
    like_run = api.diagnose(None, run_id=run)
    spec = like_run["spec"]
    assert (like_run["dataset_id"], like_run["run_id"], spec["start"]) == (dataset, run, best)
    assert (spec["division"], spec["seed"], spec["accuracy_mm"], spec["recordings"]) == ("24", 8, 0.07, ["fast"])
    # A setting that is named holds, though it be the default.
    other = api.diagnose(dataset, run_id=run, division="11", recordings=[])["spec"]
    assert (other["division"], other["recordings"], other["seed"], other["start"]) == ("11", [], 8, best)
    summary = api.diagnosed(like_run["id"])["summary"]
    assert "Started from 2 genes" in summary
    assert [one["id"] for one in api.get(f"/v1/diagnoses?run_id={run}")["items"]][-1] == like_run["id"]
    # What the run gave was copied: the diagnosis is whole without it.
    assert api.client.delete(f"/v1/runs/{run}").status_code == 204
    assert api.diagnosis(like_run["id"])["run_id"] is None
    assert api.get(f"/v1/diagnoses/{like_run['id']}/finding")["summary"] == summary


def test_a_run_without_a_genome_is_a_conflict(api: Api, gate: Gate) -> None:
    run = api.submit(api.upload()["id"])["id"]
    assert "no genome yet" in error(api, 409, run_id=run)["detail"]
    gate.let(10)


@pytest.mark.parametrize(
    ("body", "where", "message"),
    [
        ({}, "body.dataset_id", "name a dataset, or a run"),
        ({"dataset_id": "ds_none"}, "body.dataset_id", "GET /v1/datasets lists them"),
        ({"run_id": "run_none"}, "body.run_id", "GET /v1/runs lists them"),
        ({"division": "5"}, "body.division", "no strips"),
        ({"division": "x"}, "body.division", "preset 4, 11, 24"),
        ({"genes": ["nope"]}, "body.genes.0", "unknown gene; known are stiffness, damping"),
        ({"fixed": {"nope": 1.0}}, "body.fixed.nope", "unknown gene"),
        ({"fixed": {"damping": 7.0}}, "body.fixed.damping", "must lie in"),
        ({"recordings": ["nope"]}, "body.recordings.0", "known are slow, fast, unseen"),
        ({"suspects": ["nope"]}, "body", "unknown suspect 'nope'; there are hinge_offset"),
        ({"suspects": ["added_mass", "added_mass"]}, "body.suspects", "must name each once; added_mass"),
        ({"effects": ["nope"]}, "body.effects.0", "there are "),
        ({"preset": "dickinson"}, "body.preset", "means nothing for a wing"),
        ({"axes": ["z"]}, "body.axes", "means nothing for a wing"),
        ({"seed": -1}, "body.seed", "greater than or equal to 0"),
        ({"refits": 0}, "body.refits", "greater than or equal to 1"),
        ({"population": 3}, "body.population", "not permitted"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_place_and_remedy(
    shared: tuple[Api, str], body: Json, where: str, message: str
) -> None:
    api, dataset = shared
    named: Json = {} if {"dataset_id", "run_id"} & set(body) or not body else {"dataset_id": dataset}
    found = error(api, **named, **body)["errors"][0]
    assert found["where"] == where
    assert message in found["message"]
    assert api.get("/v1/diagnoses")["items"] == []


def test_a_run_on_another_dataset_is_refused(api: Api) -> None:
    run, other = api.submit(api.upload()["id"])["id"], api.upload(pad="other")["id"]
    api.finish(run)
    assert error(api, dataset_id=other, run_id=run)["errors"][0]["where"] == "body.dataset_id"


def test_a_repeated_request_makes_one_diagnosis(api: Api) -> None:
    body = {"dataset_id": api.upload()["id"]}
    first, second = (
        api.client.post("/v1/diagnoses", json=body, headers={"Idempotency-Key": "k"}).json() for _ in range(2)
    )
    assert first == second
    assert len(api.get("/v1/diagnoses")["items"]) == 1
    other = api.client.post("/v1/diagnoses", json=body | {"seed": 1}, headers={"Idempotency-Key": "k"})
    assert other.status_code == 422


def test_events_tell_every_step_and_end_with_the_verdict(api: Api, gate: Gate) -> None:
    diagnosis = api.diagnose(api.upload()["id"])["id"]
    gate.let(4)
    first = []
    with api.client.stream("GET", f"/v1/diagnoses/{diagnosis}/events") as answer:
        for event in parse(answer):
            first.append(event)
            if event[1] == "step" and event[2]["sequence"] == 3:
                break
    gate.let(STEPS)
    with api.client.stream(
        "GET", f"/v1/diagnoses/{diagnosis}/events", headers={"Last-Event-ID": first[-1][0]}
    ) as answer:
        told = [*first, *parse(answer)]
    steps = [data for _, kind, data in told if kind == "step"]
    assert [data["sequence"] for data in steps] == list(range(1, STEPS + 1))
    assert [data["progress"] for data in steps] == sorted(data["progress"] for data in steps)
    assert steps[0]["stage"] == "fitting the nominal model, part 1"
    assert told[-1][1:] == ("state", api.diagnosis(diagnosis))
    assert told[-1][2]["verdict"] == "named"
    assert api.client.get(f"/v1/diagnoses/{diagnosis}/events", headers={"Last-Event-ID": "x"}).status_code == 422


def test_a_running_diagnosis_shows_what_it_knows(api: Api, gate: Gate) -> None:
    diagnosis = api.diagnose(api.upload()["id"])["id"]
    path = f"/v1/diagnoses/{diagnosis}/partial"
    assert api.client.get(path).json() is None, "the nominal model has not been fitted"
    gate.let(5)
    api.until_diagnosis(diagnosis, lambda now: now["steps"] > toy_diagnosis.STEPS)
    known = api.get(path)
    assert (known["unit"], known["suspects"]) == ("m", len(toy_diagnosis.KNOWN))
    assert [place["misfit"] for place in known["places"]] == [1e-3, 3e-3]
    assert known["leads"][0]["effects"] == ["hinge_offset"]
    gate.let(STEPS)
    done = api.diagnosed(diagnosis)
    assert (done["fit_badge"], round(done["residual_over_noise"], 2)) == ("good", 1.0)
    assert api.client.get(path).json() is None, "it has a finding"
    assert api.client.get("/v1/diagnoses/dx_none/partial").status_code == 404


def test_cancel_and_delete(api: Api, gate: Gate) -> None:
    dataset = api.upload()["id"]
    diagnosis = api.diagnose(dataset)["id"]
    gate.let(1)
    api.until_diagnosis(diagnosis, lambda one: one["steps"] == 1)
    path = f"/v1/diagnoses/{diagnosis}"
    assert api.client.delete(path).status_code == 409
    assert api.client.post(f"{path}/cancel").json()["pending_action"] == "CANCEL"
    gate.let(1)
    done = api.diagnosed(diagnosis)
    assert (done["state"], done["steps"], done["verdict"]) == ("CANCELLED", 2, None)
    for what in ("finding", "report"):
        answer = api.client.get(f"{path}/{what}")
        assert (answer.status_code, answer.json()["state"]) == (409, "CANCELLED")
    assert api.client.post(f"{path}/cancel").status_code == 409
    assert "1 diagnosis refers to dataset" in api.client.delete(f"/v1/datasets/{dataset}").json()["detail"]
    assert api.client.delete(path).status_code == 204
    assert api.client.get(path).status_code == 404
    assert api.client.delete(f"/v1/datasets/{dataset}").status_code == 204


def test_a_cancellation_during_the_last_step_leaves_no_finding(api: Api, gate: Gate) -> None:
    diagnosis = api.diagnose(api.upload()["id"])["id"]
    gate.let(STEPS)
    api.until_diagnosis(diagnosis, lambda one: one["steps"] == STEPS)
    api.client.post(f"/v1/diagnoses/{diagnosis}/cancel")
    gate.let(1)
    assert api.diagnosed(diagnosis)["state"] == "CANCELLED"
    assert api.client.get(f"/v1/diagnoses/{diagnosis}/finding").status_code == 409


def test_a_failure_says_why_without_a_stack_trace(api: Api) -> None:
    done = api.diagnosed(api.diagnose(api.upload()["id"], seed=toy.UNLUCKY)["id"])
    assert done["state"] == "FAILED"
    assert "ArithmeticError: the thirteenth seed breaks" in done["error"]
    assert "diagnosis's data are kept" in done["error"]
    assert "Traceback" not in done["error"]


def test_runs_and_diagnoses_share_the_places(settings: Settings) -> None:
    gate = Gate()
    engine, diagnoser = toy.ToyEngine(gate=gate), toy_diagnosis.ToyDiagnoser(gate=gate)
    app = create_app(settings, engine=engine, make_evaluator=toy.NoEvaluator, diagnoser=diagnoser)
    with serving(app) as client:
        api = Api(client)
        dataset = api.upload()["id"]
        run, first, second = api.submit(dataset)["id"], api.diagnose(dataset)["id"], api.diagnose(dataset)["id"]
        api.until_diagnosis(first, lambda one: one["state"] == "RUNNING")
        assert api.diagnosis(second)["state"] == "QUEUED"
        health = api.get("/v1/health")
        assert (health["runs_active"], health["diagnoses_active"]) == (1, 2)
        gate.let(10 + 2 * (STEPS + 1))
        assert [api.finish(run)["state"], api.diagnosed(first)["state"], api.diagnosed(second)["state"]] == [
            "SUCCEEDED"
        ] * 3


def test_a_killed_server_starts_a_diagnosis_again_and_finds_the_same(tmp_path: Path) -> None:
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0.1")) as first:
        dataset = first.api.upload()["id"]
        diagnosis, cancelled = first.api.diagnose(dataset, seed=9)["id"], first.api.diagnose(dataset)["id"]
        known = first.api.until_diagnosis(diagnosis, lambda one: one["steps"] >= 4)
        first.client.post(f"/v1/diagnoses/{cancelled}/cancel")
        first.kill()
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0.02")) as second:
        done = second.api.diagnosed(diagnosis)
        assert (done["state"], done["evaluations"]) == ("SUCCEEDED", 10 * STEPS)
        assert done["steps"] >= STEPS + known["steps"], "sequences of events go on"
        found = second.api.get(f"/v1/diagnoses/{diagnosis}/finding")
        assert second.api.diagnosed(cancelled)["state"] == "CANCELLED"
        undisturbed = second.api.diagnose(dataset, seed=9)["id"]
        second.api.diagnosed(undisturbed)
        assert second.api.get(f"/v1/diagnoses/{undisturbed}/finding") == found


def test_progress_begins_again_after_a_restart(tmp_path: Path) -> None:
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0.05")) as first:
        diagnosis = first.api.diagnose(first.api.upload()["id"])["id"]
        first.api.until_diagnosis(diagnosis, lambda one: one["progress"] > 0.5)
        first.kill()
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0.3")) as second:
        again = second.api.until_diagnosis(diagnosis, lambda one: one["state"] == "RUNNING")
        assert again["progress"] < 0.5


def test_the_schema_of_findings_is_published(api: Api) -> None:
    schema = api.get("/v1/schemas/finding")
    assert {"verdict", "hypotheses", "where"} <= set(schema["properties"])
    json.dumps(schema)
