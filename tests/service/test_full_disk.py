"""A disk that takes nothing more: nothing is lost, nothing is stored by halves, and runs go on once there is room."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
from fastapi import FastAPI

from service.app import create_app
from service.database import Database
from service.settings import Settings
from tests.service import toy
from tests.service.conftest import Api, Gate, serving
from tests.service.test_restart import numbers


@contextmanager
def full(database: Database) -> Iterator[None]:
    """Within the block SQLite finds no room for another page."""

    def bound(pages: int) -> int:
        with database.write() as session:
            connection = session.connection()
            return int(connection.exec_driver_sql(f"PRAGMA max_page_count={pages}").scalar_one())

    bound(1)  # SQLite makes it the present size
    try:
        yield
    finally:
        bound(10**9)


@pytest.fixture
def app(settings: Settings, engine: toy.ToyEngine) -> FastAPI:
    return create_app(settings, engine=engine, make_evaluator=toy.NoEvaluator)


@pytest.fixture
def client(app: FastAPI) -> Iterator[httpx.Client]:
    with serving(app) as client:
        yield client


def test_an_upload_is_refused_whole(app: FastAPI, api: Api) -> None:
    before = api.upload()["id"]
    with full(app.state.service.database):
        for _ in range(3):
            answer = api.client.post("/v1/datasets", files={"file": ("toy.zip", toy.archive(pad="x" * 200_000))})
            assert (answer.status_code, answer.json()["type"]) == (507, "urn:wingfit:problem:disk-full")
        assert [one["id"] for one in api.get("/v1/datasets")["items"]] == [before]
    assert len(api.get("/v1/datasets")["items"]) == 1
    api.upload()


def test_a_run_waits_for_room_and_ends_as_if_undisturbed(app: FastAPI, api: Api, gate: Gate) -> None:
    dataset = api.upload()["id"]
    gate.let(1000)
    expected = api.submit(dataset, max_generations=60, seed=2)["id"]
    assert api.finish(expected)["state"] == "SUCCEEDED"
    while gate.open.acquire(blocking=False):
        pass
    run = api.submit(dataset, max_generations=60, seed=2)["id"]
    gate.let(3)
    api.until(run, lambda now: now["generations"] == 3)
    with full(app.state.service.database):
        gate.let(1000)
        time.sleep(1.0)
        stalled = api.run(run)
        assert stalled["state"] == "RUNNING"
        assert stalled["generations"] < 60
    assert api.finish(run)["state"] == "SUCCEEDED"
    assert numbers(api, run) == numbers(api, expected)
