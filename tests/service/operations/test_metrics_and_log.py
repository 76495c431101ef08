"""Metrics, readiness, request ids and the JSON log."""

from __future__ import annotations

import json
import logging
import re
import time
from pathlib import Path

import httpx
import pytest
import yaml
from prometheus_client.parser import text_string_to_metric_families

from tests.service import toy
from tests.service.conftest import Api, Gate, metrics, serving
from tests.service.processes import ROOT, ServerProcess
from wingfit.service.app import create_app
from wingfit.service.operations.metrics_and_log import JsonFormatter
from wingfit.service.settings import Settings, SettingsError
from wingfit.workers.watch import Standing

Samples = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def samples(client: httpx.Client) -> Samples:
    answer = metrics(client)
    assert answer.headers["Content-Type"].startswith("text/plain; version=")
    families = text_string_to_metric_families(answer.text)
    return {(s.name, tuple(sorted(s.labels.items()))): s.value for family in families for s in family.samples}


def requests(found: Samples, path: str, status: int, method: str = "GET") -> float:
    labels = (("method", method), ("path", path), ("status", str(status)))
    return found.get(("wingfit_http_requests_total", labels), 0.0)


def test_metrics_count_requests_and_jobs(api: Api) -> None:
    run = api.submit(api.upload()["id"])["id"]
    api.finish(run)
    for _ in range(3):
        api.run(run)
    api.client.get("/v1/runs/run_none")
    api.client.get("/v1/made-up-by-a-caller")
    api.client.get("/v1/session", headers={"Host": "evil.example"})
    found = samples(api.client)
    assert requests(found, "/v1/runs/{run_id}", 200) >= 4
    assert requests(found, "/v1/runs/{run_id}", 404) == 1
    assert requests(found, "/v1/datasets", 201, "POST") == 1
    assert requests(found, "other", 400) == 1
    assert not any("made-up" in str(key) for key in found)
    assert found["wingfit_jobs", (("kind", "run"), ("state", "SUCCEEDED"))] == 1
    assert found["wingfit_jobs", (("kind", "diagnosis"), ("state", "RUNNING"))] == 0
    assert found["wingfit_evaluator_up", ()] == 1
    assert found["wingfit_database_bytes", ()] > 10_000
    timed = (("method", "GET"), ("path", "/v1/runs/{run_id}"))
    assert found["wingfit_http_request_seconds_count", timed] >= 5


def test_open_event_streams_are_counted(api: Api, gate: object) -> None:
    assert gate is not None
    run = api.submit(api.upload()["id"])["id"]
    with api.client.stream("GET", f"/v1/runs/{run}/events") as stream:
        received = stream.iter_bytes()
        assert next(received)
        assert samples(api.client)["wingfit_watchers", ()] == 1


def test_not_ready_until_jobs_are_computed(tmp_path: Path) -> None:
    def never() -> toy.NoEvaluator:
        raise ValueError("no processors")

    with serving(create_app(Settings(data=tmp_path), engine=toy.ToyEngine(), make_evaluator=never)) as client:
        answer = client.get("/v1/ready")
        assert (answer.status_code, answer.json()["type"]) == (503, "urn:wingfit:problem:not-ready")
        assert client.get("/v1/health").status_code == 200


def test_not_ready_while_no_worker_lives(tmp_path: Path) -> None:
    evaluator = toy.NoEvaluator()
    app = create_app(Settings(data=tmp_path), engine=toy.ToyEngine(), make_evaluator=lambda: evaluator)
    with serving(app) as client:
        api = Api(client)
        Api._until(lambda: api.get("/v1/health"), lambda health: health["status"] == "ok", 60.0)
        evaluator.standing = Standing(0, 1, 2, 1)
        answer = client.get("/v1/ready")
        assert (answer.status_code, "there is no worker" in answer.json()["detail"]) == (503, True)
        assert (api.get("/v1/health")["status"], api.get("/v1/health")["workers"]) == ("degraded", 0)
        found = samples(client)
        assert found["wingfit_workers", ()] == 0
        assert found["wingfit_evaluator_up", ()] == 0
        assert found["wingfit_worker_deaths_total", (("reason", "died"),)] == 1
        assert found["wingfit_worker_deaths_total", (("reason", "hung"),)] == 2
        assert found["wingfit_worker_restarts_total", ()] == 1


def test_stalled_jobs_and_the_age_of_the_queue_are_reported(api: Api, gate: Gate) -> None:
    dataset = api.upload()["id"]
    runs = [api.submit(dataset)["id"] for _ in range(3)]  # two at a time
    api.until(runs[0], lambda run: run["state"] == "RUNNING")
    time.sleep(0.3)
    found = samples(api.client)
    assert 0.2 < found["wingfit_job_stalled_seconds", ()] < 20
    assert 0.2 < found["wingfit_queue_age_seconds", ()] < 20
    assert found["wingfit_disk_free_bytes", ()] > 0
    gate.let(100)
    for run in runs:
        api.finish(run)
    Api._until(
        lambda: {"stalled": samples(api.client)["wingfit_job_stalled_seconds", ()]}, lambda s: not s["stalled"], 5
    )
    assert samples(api.client)["wingfit_queue_age_seconds", ()] == 0


def test_the_example_alerts_use_existing_metrics(api: Api) -> None:
    rules = yaml.safe_load((ROOT / "deploy/prometheus/alerts.yml").read_text())
    (group,) = rules["groups"]
    api.get("/v1/runs")  # a request is counted once it is answered
    known = {name for name, _ in samples(api.client)} | {"up"}
    for rule in group["rules"]:
        named = set(re.findall(r"\bwingfit_\w+", rule["expr"])) | ({"up"} if "up{" in rule["expr"] else set())
        assert named, rule["alert"]
        assert named <= known, rule["alert"]
        assert rule["annotations"]["summary"]
        assert rule["labels"]["severity"] in ("page", "ticket")


def test_ready(api: Api) -> None:
    Api._until(lambda: api.get("/v1/health"), lambda health: health["status"] == "ok", 60.0)
    assert api.get("/v1/ready")["status"] == "ok"


def test_every_answer_has_a_request_id(client: httpx.Client) -> None:
    first, second = (client.get("/v1/health").headers["X-Request-ID"] for _ in range(2))
    assert first != second
    given = {"X-Request-ID": "trace-7"}
    assert client.get("/v1/health", headers=given).headers["X-Request-ID"] == "trace-7"
    for bad in ("a" * 65, "two words", "x;y"):
        assert client.get("/v1/health", headers={"X-Request-ID": bad}).headers["X-Request-ID"] != bad


def test_the_log_can_be_json(tmp_path: Path) -> None:
    env = {"WINGFIT_LOG": "json"}
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0"), env) as server:
        server.client.get("/v1/runs/run_none", headers={"X-Request-ID": "trace-8"})
        server.client.get("/v1/health")
        lines = [json.loads(line) for line in server.log.splitlines()]
    (line,) = [one for one in lines if one.get("request") == "trace-8" and one["logger"] == "wingfit.access"]
    assert (line["message"], line["level"]) == ("GET /v1/runs/run_none 404", "INFO")
    assert 0 < line["ms"] < 10_000


def test_an_exception_is_one_line_of_json() -> None:
    try:
        raise ValueError("no\nsuch")
    except ValueError as error:
        told = (type(error), error, error.__traceback__)
        record = logging.LogRecord("wingfit", logging.ERROR, __file__, 1, "%s failed", ("run",), told)
    line = JsonFormatter().format(record)
    assert "\n" not in line
    assert json.loads(line)["message"] == "run failed"
    assert "ValueError" in json.loads(line)["exception"]


def test_an_invalid_log_format_is_named() -> None:
    with pytest.raises(SettingsError, match="WINGFIT_LOG"):
        Settings.from_env({"WINGFIT_LOG": "xml"})
