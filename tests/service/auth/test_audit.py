"""The audit log has a line for every attempt to change something, which no caller can forge."""

from __future__ import annotations

import json
import logging
import re
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.service import toy
from tests.service.conftest import As, made, toy_service
from tests.service.processes import ServerProcess
from wingfit.service.settings import Settings

Line = tuple[object, ...]
FIELDS = ("method", "template", "path", "status", "key", "owner")


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data", require_keys=True)


class Audited:
    """The lines since they were last taken."""

    def __init__(self, caplog: pytest.LogCaptureFixture) -> None:
        self._caplog = caplog

    def take(self, count: int) -> list[logging.LogRecord]:
        """``count`` lines, and no more; a line comes when the answer has gone out."""
        deadline = time.monotonic() + 60
        while len(found := self._lines()) < count:
            assert time.monotonic() < deadline, found
            time.sleep(0.01)
        assert len(found) == count, found
        self._caplog.clear()
        return found

    def _lines(self) -> list[logging.LogRecord]:
        return [record for record in self._caplog.records if record.name == "wingfit.audit"]


@pytest.fixture
def audited(caplog: pytest.LogCaptureFixture) -> Audited:
    caplog.set_level(logging.INFO, "wingfit.audit")
    return Audited(caplog)


def fields(record: logging.LogRecord) -> Line:
    return tuple(getattr(record, name) for name in FIELDS)


def test_every_change_is_logged_with_caller_and_status(as_: As, audited: Audited) -> None:
    ann, admin = as_("ann"), as_("admin")
    key, root = (api.get("/v1/session")["key_id"] for api in (ann, admin))
    dataset = ann.upload()["id"]
    run = ann.submit(dataset)["id"]
    ann.finish(run)
    answer = ann.client.delete(f"/v1/runs/{run}", headers={"X-Request-ID": "trace-9"})
    assert answer.status_code == 204
    new = admin.client.post("/v1/keys", json={"name": "new"}).json()["id"]
    admin.client.delete(f"/v1/keys/{new}")
    records = audited.take(5)
    assert [fields(record) for record in records] == [
        ("POST", "/v1/datasets", "/v1/datasets", 201, key, "ann"),
        ("POST", "/v1/runs", "/v1/runs", 202, key, "ann"),
        ("DELETE", "/v1/runs/{run_id}", f"/v1/runs/{run}", 204, key, "ann"),
        ("POST", "/v1/keys", "/v1/keys", 201, root, "admin"),
        ("DELETE", "/v1/keys/{key_id}", f"/v1/keys/{new}", 200, root, "admin"),
    ]
    assert records[2].request == "trace-9"  # type: ignore[attr-defined]
    assert records[2].getMessage() == (
        f"DELETE /v1/runs/{{run_id}} 204 key={key} owner='ann' path='/v1/runs/{run}' request=trace-9"
    )
    assert all(record.levelno == logging.INFO for record in records)


def test_refused_and_failed_changes_are_logged(
    as_: As, client: httpx.Client, audited: Audited, secrets: dict[str, str]
) -> None:
    reads = as_("ann-reads")
    key = reads.get("/v1/session")["key_id"]
    for method, path in (("POST", "/v1/runs"), ("PUT", "/v1/runs"), ("PATCH", "/v1/x")):
        assert client.request(method, path).status_code == 401
        assert reads.client.request(method, path).status_code == 403
    assert client.post("/v1/runs", headers={"Host": "evil.example"}).status_code == 400
    assert client.post("/v1/runs", headers={"Origin": "http://evil.example"}).status_code == 403
    assert as_("ann").client.put("/v1/runs").status_code == 405
    assert as_("ann").client.post("/v1/runs", json={"dataset_id": "none"}).status_code == 422
    assert client.post("/v1/session", json={"key": "wrong"}).status_code == 401
    assert client.post("/v1/session", json={"key": secrets["ann-reads"]}).status_code == 200
    found = [fields(record) for record in audited.take(12)]
    assert found[:2] == [
        ("POST", "-", "/v1/runs", 401, "-", "-"),
        ("POST", "-", "/v1/runs", 403, key, "ann"),
    ]
    assert [line[3] for line in found] == [401, 403, 401, 403, 401, 403, 400, 403, 405, 422, 401, 200]
    assert found[-2:] == [
        ("POST", "/v1/session", "/v1/session", 401, "-", "-"),
        ("POST", "/v1/session", "/v1/session", 200, key, "ann"),
    ]


def test_internal_errors_are_logged_in_the_audit_log(tmp_path: Path, audited: Audited) -> None:
    with toy_service(tmp_path) as (service, api):
        service.engine.load = None  # type: ignore[method-assign, assignment]
        assert api.client.post("/v1/datasets", files={"file": ("a.zip", toy.archive())}).status_code == 500
    assert [fields(record) for record in audited.take(1)] == [("POST", "/v1/datasets", "/v1/datasets", 500, "-", "-")]


def test_reading_is_not_logged(as_: As, audited: Audited) -> None:
    ann = as_("ann")
    ann.get("/v1/runs")
    ann.client.head("/v1/runs")
    ann.client.options("/v1/runs")
    ann.client.post("/nothing")  # no part of the API
    assert ann.client.delete("/v1/runs/none").status_code == 404
    audited.take(1)  # and none before it


FORGED = "2026-01-01 00:00:00,000 INFO wingfit.audit: DELETE /v1/keys/{key_id} 200 key=key_admin"
HOSTILE = ["%0A", "%0D%0A", "%0D", "%E2%80%A8", "%C2%85", "%1B[2J%1B]0;x%07", "%7F", "%0B%0C", "%00", "%27%20key=x"]


@pytest.mark.parametrize("form", ["text", "json"])
def test_no_path_and_no_name_forges_a_line(tmp_path: Path, form: str) -> None:
    owner = f"eve\n{FORGED}\x1b[2J"
    secret = made(tmp_path / "data", "eve", "read", "write", owner=owner)
    env = {"WINGFIT_LOG": form, "WINGFIT_REQUIRE_KEYS": "1"}
    made(tmp_path / "data", "admin", "admin")
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0"), env) as server:
        for hostile in HOSTILE:
            path = f"/v1/runs/{hostile}{FORGED.replace(' ', '%20')}".replace("{", "%7B").replace("}", "%7D")
            answer = server.client.delete(path, headers={"Authorization": f"Bearer {secret}"})
            assert answer.status_code in (404, 405)
        deadline = time.monotonic() + 60  # a line comes when the answer has gone out
        while len(_written(server.log)) < len(HOSTILE):
            assert time.monotonic() < deadline, server.log
            time.sleep(0.01)
        log = server.log
    written = _written(log)
    assert len(written) == len(HOSTILE)
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029]", "".join(written))
    assert not any(line.startswith(FORGED[:20]) for line in log.splitlines())
    for line in written:
        assert _is_whole(line, form), line


def _written(log: str) -> list[str]:
    """The lines that a reader of the log takes for lines of the audit."""
    said = re.compile(r'[\d-]+ [\d:,]+ INFO wingfit\.audit: |.*"logger": "wingfit\.audit"')
    return [line for line in log.splitlines() if said.match(line)]


def _is_whole(line: str, form: str) -> bool:
    if form == "text":
        whole = (
            r"[\d-]+ [\d:,]+ INFO wingfit\.audit: DELETE \S+ \d+ key=key_\w+ owner='.*' path=(['\"]).*\1 request=\w+"
        )
        return re.fullmatch(whole, line) is not None
    parsed: dict[str, Any] = json.loads(line)
    return parsed["logger"] == "wingfit.audit" and parsed["key"].startswith("key_") and parsed["status"] in (404, 405)


def test_no_internal_error_forges_a_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def fails(*_: object) -> None:
        raise ArithmeticError("a mistake")

    with toy_service(tmp_path) as (service, api):
        service.database.read = fails  # type: ignore[method-assign, assignment]
        assert api.client.get("/v1/datasets/x%0AFORGED").status_code == 500
    (line,) = [record.getMessage() for record in caplog.records if record.name == "wingfit.http"]
    assert line == "GET '/v1/datasets/x\\nFORGED' failed"


def test_a_long_path_is_cut(as_: As, audited: Audited) -> None:
    as_("ann").client.delete(f"/v1/runs/{'x' * 5000}")
    (record,) = audited.take(1)
    assert len(record.getMessage()) < 1500
