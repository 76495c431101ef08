"""Access of other owners to every call of the OpenAPI document, so that a call added later is tested as well."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.service import toy
from tests.service.conftest import As
from tests.service.films.films import ended, submitted, uploaded, write_videos
from tests.tracking.alignment.recorded import ROBIRD
from wingfit.service.settings import Settings

ADMINISTRATION = re.compile(r"/v1/(?:keys|backup)(?:/|$)")
OPEN = ("/v1/health", "/v1/ready", "/v1/session")
OF_A_THING = re.compile(r"{(dataset_id|run_id|diagnosis_id|job_id|film_id|tracking_id)}")
KINDS = ("datasets", "runs", "diagnoses", "films", "trackings")
Call = tuple[str, str, dict[str, Any]]


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data", require_keys=True, max_stored_mb=1)


@pytest.fixture
def calls(client: httpx.Client) -> list[Call]:
    """Method, path and body of every call; bodies are the examples of their schema."""
    specification = client.get("/openapi.json").json()
    return list(_calls(specification))


def _calls(specification: dict[str, Any]) -> Iterator[Call]:
    for path, methods in specification["paths"].items():
        for method, operation in methods.items():
            content = operation.get("requestBody", {}).get("content", {}).get("application/json")
            name = content["schema"]["$ref"].rpartition("/")[2] if content else ""
            yield method.upper(), path, specification["components"]["schemas"][name]["examples"][0] if name else {}


def test_every_call_with_an_id_is_closed_to_other_owners(as_: As, calls: list[Call], tmp_path: Path) -> None:
    ann, bob = as_("ann"), as_("bob")
    dataset = ann.upload()["id"]
    run, diagnosis = ann.submit(dataset)["id"], ann.diagnose(dataset)["id"]
    ann.finish(run)
    ann.diagnosed(diagnosis)
    film = uploaded(ann, write_videos(tmp_path, frames=3))["id"]
    tracking = submitted(ann, film)["id"]
    ids = {"dataset_id": dataset, "run_id": run, "diagnosis_id": diagnosis, "job_id": run, "film_id": film}
    ids |= {"tracking_id": tracking, "name": "left", "camera": "left", "number": "0"}
    tried = 0
    for method, path, body in calls:
        if not OF_A_THING.search(path):
            continue
        asked = path.format(**ids)
        answer = bob.client.request(method, asked, json=body or None)
        assert answer.status_code == 404, (method, asked, answer.text)
        assert answer.json()["type"] == "urn:wingfit:problem:not-found"
        tried += 1
    assert tried >= 33
    named = {"tracking_id": tracking, "name": "run", "rig": "vacuum_chamber", "flap_frequency_hz": 3.0}
    named |= {"phase_lag_deg": 0.0, "pressure_mbar": 10.0, "temperature_c": 20.0}
    wing = (ROBIRD / "dataset.yaml").read_text()
    for path, sent, where in (
        ("/v1/trackings", {"film_id": film, "kind": "dot", "light": "continuous"}, "body.film_id"),
        ("/v1/trackings/dataset", {"name": "films", "description": wing, "recordings": [named]}, "body.recordings.0"),
    ):
        answer = bob.client.post(path, json=sent)
        assert answer.status_code == 422, answer.text
        assert answer.json()["errors"][0]["where"].startswith(where)
        assert "there is no such" in answer.json()["errors"][0]["message"]
    assert ended(ann, tracking)["state"] == "SUCCEEDED"
    assert ann.diagnosis(diagnosis)["state"] == ann.run(run)["state"] == "SUCCEEDED"


def test_no_body_reaches_data_of_another_owner(as_: As, calls: list[Call]) -> None:
    ann, bob = as_("ann"), as_("bob")
    dataset = ann.upload()["id"]
    run = ann.submit(dataset)["id"]
    ann.finish(run)
    tried = 0
    for method, path, body in calls:
        for name, one in (("dataset_id", dataset), ("run_id", run)):
            if method != "POST" or (name not in body and path != "/v1/diagnoses"):
                continue
            named = {key: value for key, value in body.items() if key != "dataset_id"} | {name: one}
            answer = bob.client.post(path, json=named)
            assert answer.status_code == 422, (path, name, answer.text)
            assert "there is no" in answer.json()["detail"], (path, name)
            tried += 1
    assert tried == 7
    assert all(bob.get(f"/v1/{kind}")["items"] == [] for kind in KINDS)


def test_every_call_needs_its_scope(as_: As, calls: list[Call]) -> None:
    reader, writer = as_("ann-reads").client, as_("ann").client
    refused = {"reader": 0, "writer": 0}
    for method, path, body in calls:
        if path in OPEN:
            continue
        asked, sent = re.sub(r"[{}]", "", path), body or None
        if method != "GET" or ADMINISTRATION.match(path):
            answer = reader.request(method, asked, json=sent)
            assert (answer.status_code, answer.json()["type"]) == (403, "urn:wingfit:problem:scope"), (method, path)
            refused["reader"] += 1
        if ADMINISTRATION.match(path):
            answer = writer.request(method, asked, json=sent)
            assert (answer.status_code, answer.json()["type"]) == (403, "urn:wingfit:problem:scope"), (method, path)
            refused["writer"] += 1
    assert refused["reader"] >= 15
    assert refused["writer"] >= 4


@pytest.mark.parametrize(
    "path",
    [
        "//v1/keys",
        "/v1//keys",
        "/V1/keys",
        "/v1/keys/",
        "/%76%31/keys",
        "/v1/./keys",
        "/v1/x/../keys",
        "/v1%2fkeys",
        "/v1/keys;x=1",
        "/v1/keys%00",
        "/assets/../v1/keys",
        "/.//v1/keys",
    ],
)
def test_no_spelling_of_a_path_bypasses_authentication(client: httpx.Client, path: str) -> None:
    for method in ("GET", "POST", "HEAD", "PUT", "PROPFIND"):
        request = client.build_request(method, client.base_url)
        request.url = request.url.copy_with(raw_path=path.encode())
        answer = client.send(request)
        assert answer.status_code in (401, 404, 405), (method, answer.status_code)


def test_a_caller_cannot_set_an_owner(as_: As) -> None:
    ann = as_("ann")
    dataset = ann.upload()["id"]
    for path, body in (
        ("runs", {"dataset_id": dataset, "owner": "bob"}),
        ("runs", {"dataset_id": dataset, "state": "SUCCEEDED"}),
        ("diagnoses", {"dataset_id": dataset, "id": "dx_0000000000000000"}),
    ):
        assert ann.client.post(f"/v1/{path}", json=body).status_code == 422, body
    sent = {"files": {"file": ("a.zip", toy.archive())}, "data": {"owner": "bob", "id": "ds_0"}}
    assert ann.client.post("/v1/datasets", **sent).json()["id"] != "ds_0"  # type: ignore[arg-type]
    assert len(ann.get("/v1/datasets")["items"]) == 2
    assert as_("bob").get("/v1/datasets")["items"] == []


def test_no_owner_fills_the_disk(as_: As) -> None:
    ann, half = as_("ann"), "x" * 600_000
    first = ann.upload(pad=half)
    refused = ann.client.post("/v1/datasets", files={"file": ("a.zip", toy.archive(pad=half))})
    assert (refused.status_code, refused.json()["type"]) == (429, "urn:wingfit:problem:too-many")
    assert "WINGFIT_MAX_STORED_MB" in refused.json()["detail"]
    assert len(ann.get("/v1/datasets")["items"]) == 1
    as_("bob").upload(pad=half)
    assert ann.client.delete(f"/v1/datasets/{first['id']}").status_code == 204
    ann.upload(pad=half)


def test_a_key_is_in_no_log(
    as_: As, client: httpx.Client, secrets: dict[str, str], caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG), caplog.at_level(logging.DEBUG, "wingfit.access"):
        as_("ann").get("/v1/runs")
        client.post("/v1/session", json={"key": secrets["ann"]})
        new = as_("admin").client.post("/v1/keys", json={"name": "x"}).json()["secret"]
        client.get("/v1/runs", headers={"Authorization": f"Bearer {new}x"})
    records = [record for record in caplog.records if not record.name.startswith("http")]  # this client's own
    told = "\n".join(record.getMessage() for record in records)
    assert "GET /v1/runs" in told
    assert not [secret for secret in (*secrets.values(), new) if secret in told]
