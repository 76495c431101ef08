"""Event streams end when their key is revoked; those of other keys go on and miss nothing."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from tests.service import toy, toy_diagnosis
from tests.service.conftest import Api, As, Gate, serving
from tests.service.http.test_events import Event, parse
from wingfit.service.app import create_app
from wingfit.service.auth import keys
from wingfit.service.settings import Settings

MOST_SECONDS = 60.0  # on a busy machine


class Watcher:
    """Reads the events at ``path`` in a thread until they end."""

    def __init__(self, api: Api, path: str) -> None:
        self.events: list[Event] = []
        self.status = 0
        self._api, self._path = api, path
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        with self._api.client.stream("GET", self._path) as answer:
            self.status = answer.status_code
            for event in parse(answer):
                self.events.append(event)

    def until(self, count: int) -> None:
        deadline = time.monotonic() + 60
        while len(self.events) < count:
            assert time.monotonic() < deadline, self.events
            time.sleep(0.01)

    def ended(self, seconds: float) -> bool:
        self._thread.join(seconds)
        return not self._thread.is_alive()


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data", require_keys=True)


@pytest.fixture
def app(settings: Settings, gate: Gate, secrets: dict[str, str]) -> FastAPI:
    assert secrets
    diagnoser = toy_diagnosis.ToyDiagnoser(gate=gate)
    return create_app(settings, engine=toy.ToyEngine(gate=gate), make_evaluator=toy.NoEvaluator, diagnoser=diagnoser)


@pytest.fixture
def client(app: FastAPI) -> Iterator[httpx.Client]:
    with serving(app) as client:
        yield client


def key_of(api: Api) -> str:
    return str(api.get("/v1/session")["key_id"])


@pytest.mark.parametrize("kind", ["runs", "diagnoses"])
def test_streams_of_a_revoked_key_end_and_others_miss_nothing(
    as_: As, gate: Gate, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingfit.service.http.events.HEARTBEAT_SECONDS", 1000.0)  # not at the next heartbeat: at once
    ann, reads, admin = as_("ann"), as_("ann-reads"), as_("admin")
    dataset = ann.upload()["id"]
    job = (ann.submit(dataset) if kind == "runs" else ann.diagnose(dataset))["id"]
    path = f"/v1/{kind}/{job}/events"
    revoked = [Watcher(reads, path) for _ in range(3)]
    others = [Watcher(ann, path), Watcher(admin, path)]
    gate.let(2)
    for one in (*revoked, *others):
        one.until(3)
    assert admin.client.delete(f"/v1/keys/{key_of(reads)}").status_code == 200
    assert all(one.ended(MOST_SECONDS) for one in revoked)
    seen = [len(one.events) for one in revoked]
    assert not any(one.ended(0.3) for one in others)
    gate.let(100)
    assert all(one.ended(MOST_SECONDS) for one in others)
    for one in others:
        steps = [data["sequence"] for _, name, data in one.events if name != "state"]
        assert steps == list(range(1, len(steps) + 1))
        assert len(steps) >= 10
        assert one.events[-1][2]["state"] == "SUCCEEDED"
    assert [len(one.events) for one in revoked] == seen
    assert reads.client.get(path).status_code == 401


def test_a_stream_whose_key_is_revoked_while_it_opens_sends_nothing(
    app: FastAPI, as_: As, gate: Gate, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The gate has let the request in; the key is revoked before the stream watches."""
    service = app.state.service
    ann, reads = as_("ann"), as_("ann-reads")
    run, key = ann.submit(ann.upload()["id"])["id"], key_of(reads)
    gate.let(2)
    ann.until(run, lambda now: now["generations"] == 2)
    watch: Callable[[str], AbstractContextManager[object]] = service.changes.watch

    def revoked_first(run_id: str) -> AbstractContextManager[object]:
        with service.database.write() as session:
            keys.revoke(session, key)
        service.load_keys()
        return watch(run_id)

    monkeypatch.setattr(service.changes, "watch", revoked_first)
    late = Watcher(reads, f"/v1/runs/{run}/events")
    assert late.ended(MOST_SECONDS)
    assert (late.status, late.events) == (200, [])
    gate.let(100)


def test_a_new_key_ends_no_stream(as_: As, gate: Gate) -> None:
    ann, admin = as_("ann"), as_("admin")
    run = ann.submit(ann.upload()["id"])["id"]
    watching = Watcher(ann, f"/v1/runs/{run}/events")
    watching.until(1)
    assert admin.client.post("/v1/keys", json={"name": "new"}).status_code == 201
    assert not watching.ended(0.3)
    gate.let(100)
    assert watching.ended(MOST_SECONDS)
    assert watching.events[-1][2]["state"] == "SUCCEEDED"
