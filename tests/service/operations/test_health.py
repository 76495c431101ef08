"""Health, readiness and metrics answer at once, whatever else is slow."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from tests.service import toy
from tests.service.conftest import Api, toy_service
from wingfit.service.operations import health
from wingfit.service.storage.database import Database

ANYIO_THREADS = 40


def timed(client: httpx.Client, path: str) -> tuple[httpx.Response, float]:
    began = time.monotonic()
    answer = client.get(path, timeout=60)
    return answer, time.monotonic() - began


@contextmanager
def every_thread_held(api: Api, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    entered, go = threading.Semaphore(0), threading.Event()

    def held(*given: object) -> None:  # noqa: ARG001
        entered.release()
        assert go.wait(60)

    monkeypatch.setattr(toy.ToyEngine, "check", held)
    body = {"dataset_id": api.upload()["id"]}
    with ThreadPoolExecutor(ANYIO_THREADS) as crowd:
        for _ in range(ANYIO_THREADS):
            crowd.submit(httpx.post, f"{api.client.base_url}/v1/runs", json=body, timeout=90)
        for _ in range(ANYIO_THREADS):
            assert entered.acquire(timeout=60)
        try:
            yield
        finally:
            go.set()


@contextmanager
def silent_database(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    go, look = threading.Event(), Database.look

    @contextmanager
    def held(database: Database) -> Iterator[object]:
        assert go.wait(60)
        with look(database) as found:
            yield found

    with monkeypatch.context() as patched:
        patched.setattr(Database, "look", held)
        yield
        go.set()


def test_health_does_not_wait_for_the_threads_of_requests_or_for_the_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with toy_service(tmp_path) as (_, api):
        api._until(lambda: api.get("/v1/health"), lambda now: now["status"] == "ok", 60.0)
        with every_thread_held(api, monkeypatch):
            for path in ("/v1/health", "/v1/ready", "/v1/metrics"):
                answer, seconds = timed(api.client, path)
                assert answer.status_code == 200, path
                assert seconds < 30, path  # the threads are held for longer
            with silent_database(monkeypatch):
                answer, seconds = timed(api.client, "/v1/health")
                assert (answer.status_code, answer.json()["status"]) == (200, "degraded")
                assert seconds < health.READ_SECONDS + 30
                assert answer.json()["runs_active"] is None
                assert "the database does not answer within 1 s" in answer.json()["detail"]
                again = [timed(api.client, "/v1/health") for _ in range(5)]  # while the same look goes on
                assert {answer.json()["status"] for answer, _ in again} == {"degraded"}
                assert min(seconds for _, seconds in again) < health.READ_SECONDS
                answer, _ = timed(api.client, "/v1/ready")
                assert (answer.status_code, answer.headers["Retry-After"]) == (503, "5")
                assert "the database does not answer" in answer.json()["detail"]
                answer, _ = timed(api.client, "/v1/metrics")
                assert "wingfit_database_up 0.0" in answer.text
        api._until(lambda: api.get("/v1/health"), lambda now: now["status"] == "ok", 60.0)
        assert "wingfit_database_up 1.0" in api.client.get("/v1/metrics").text


def test_concurrent_callers_share_one_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with toy_service(tmp_path) as (service, api), ThreadPoolExecutor(20) as crowd:
        looks = []
        count = service.health._counting._function

        def counted() -> health.Jobs:
            looks.append(threading.current_thread().name)
            time.sleep(0.5)
            return count()

        monkeypatch.setattr(service.health._counting, "_function", counted)
        url = f"{api.client.base_url}/v1/health"
        answers = list(crowd.map(lambda _: httpx.get(url, timeout=60), range(20)))
        assert {answer.status_code for answer in answers} == {200}
        assert len(looks) <= 3
        assert set(looks) == {"health"}


def test_an_unreadable_database_is_no_internal_error(tmp_path: Path) -> None:
    with toy_service(tmp_path) as (service, api):
        with service.database.write() as session:
            session.connection().exec_driver_sql("ALTER TABLE diagnosis RENAME TO gone")
        answer = api.client.get("/v1/health")
        assert (answer.status_code, answer.json()["status"]) == (200, "degraded")
        assert "the database cannot be read: no such table" in answer.json()["detail"]
        with service.database.write() as session:
            session.connection().exec_driver_sql("ALTER TABLE gone RENAME TO diagnosis")
