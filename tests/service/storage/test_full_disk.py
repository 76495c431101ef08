"""A disk that takes nothing more: nothing is lost, nothing is stored by halves, and runs go on once there is room."""

from __future__ import annotations

import errno
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import httpx
import pytest
from fastapi import FastAPI

from tests.service import toy
from tests.service.conftest import Api, Gate, serving
from tests.service.jobs.test_restart import numbers
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.service.storage.database import Database


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


LARGE = b"x" * (3 * 2**20)  # more than the framework keeps in memory


def post(client: httpx.Client) -> httpx.Response:
    return client.post("/v1/datasets", files={"file": ("large.zip", LARGE)})


def full_file(*_: object, **__: object) -> BinaryIO:
    return Path("/dev/full").open("r+b", buffering=0)  # every write to it fails as on a full disk


def test_a_full_folder_for_temporary_files_is_told_in_words(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(tempfile, "TemporaryFile", full_file)
        answer = post(client)
    assert (answer.status_code, answer.json()["type"]) == (507, "urn:wingfit:problem:disk-full")
    assert answer.headers["Retry-After"] == "30"
    detail = answer.json()["detail"]
    assert f"the folder for temporary files of the server, {tempfile.gettempdir()}, is full" in detail
    assert "No space left on device" in detail
    assert "make room there, or set TMPDIR" in detail
    assert "No space left on device" in caplog.text
    assert post(client).status_code == 422  # it is no archive
    assert client.post("/v1/datasets", content=b"no form").status_code == 422


@pytest.mark.parametrize("gone", ["none", "removed"])
def test_no_folder_for_temporary_files_is_told_in_words(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, gone: str
) -> None:
    with monkeypatch.context() as patch:
        if gone == "none":
            patch.setattr(tempfile, "tempdir", None)
            patch.setattr(tempfile, "_candidate_tempdir_list", lambda: ["/proc/1/none"])
        else:
            patch.setattr(tempfile, "tempdir", str(tmp_path / "removed"))
        answer = post(client)
    assert (answer.status_code, answer.json()["type"]) == (507, "urn:wingfit:problem:disk-full")
    detail = answer.json()["detail"]
    assert "no folder for temporary files that it can use" in detail
    assert ("/proc/1/none" if gone == "none" else str(tmp_path / "removed")) in detail
    assert "set TMPDIR" in detail


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_anywhere_in_a_request_is_told_in_words(
    app: FastAPI, api: Api, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, number: int
) -> None:
    def fails(*_: object) -> None:
        raise OSError(number, os.strerror(number), str(tmp_path / "scratch" / "file"))

    monkeypatch.setattr(app.state.service.engine, "load", fails)
    answer = api.client.post("/v1/datasets", files={"file": ("toy.zip", toy.archive())})
    assert (answer.status_code, answer.json()["type"]) == (507, "urn:wingfit:problem:disk-full")
    assert f"({os.strerror(number)}), at {tmp_path / 'scratch'}: make room there" in answer.json()["detail"]
    assert answer.headers["X-Frame-Options"] == "DENY"


def test_other_errors_of_the_system_are_mistakes(app: FastAPI, api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise FileNotFoundError(errno.ENOENT, "No such file or directory", "/some/secret")

    monkeypatch.setattr(app.state.service.engine, "load", fails)
    answer = api.client.post("/v1/datasets", files={"file": ("toy.zip", toy.archive())})
    assert answer.status_code == 500
    assert "secret" not in answer.text
