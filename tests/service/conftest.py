"""The application behind a real socket, over a database in a temporary folder."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import httpx
import pytest
import uvicorn
from fastapi import FastAPI

from tests.service import toy, toy_diagnosis
from tests.service.pages.browsing import chromium
from wingfit.client.private_files import make_file
from wingfit.service.app import create_app
from wingfit.service.auth import keys
from wingfit.service.container import Service
from wingfit.service.http.header_limits import Protocol
from wingfit.service.settings import Settings
from wingfit.service.storage.database import FILE_NAME, Database, make_folder

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FINAL = ("SUCCEEDED", "FAILED", "CANCELLED")

Json = dict[str, Any]


class Gate:
    """Holds the toy search before each generation until opened."""

    def __init__(self) -> None:
        self.open = threading.Semaphore(0)

    def __call__(self, done: int) -> None:  # noqa: ARG002
        assert self.open.acquire(timeout=60)

    def let(self, generations: int) -> None:
        self.open.release(generations)


class Api:
    """The calls that most tests make."""

    def __init__(self, client: httpx.Client) -> None:
        self.client = client

    def upload(self, **changes: Any) -> Json:
        answer = self.client.post("/v1/datasets", files={"file": ("toy.zip", toy.archive(**changes))})
        assert answer.status_code == 201, answer.text
        return dict(answer.json())

    def submit(self, dataset_id: str, **body: Any) -> Json:
        answer = self.client.post("/v1/runs", json={"dataset_id": dataset_id, "max_generations": 5} | body)
        assert answer.status_code == 202, answer.text
        return dict(answer.json())

    def get(self, path: str) -> Json:
        answer = self.client.get(path)
        assert answer.status_code == 200, answer.text
        return dict(answer.json())

    def run(self, run_id: str) -> Json:
        return self.get(f"/v1/runs/{run_id}")

    def control(self, run_id: str, what: str) -> Json:
        answer = self.client.post(f"/v1/runs/{run_id}/{what}")
        assert answer.status_code == 202, answer.text
        return dict(answer.json())

    def until(self, run_id: str, condition: Callable[[Json], bool], seconds: float = 60.0) -> Json:
        return self._until(lambda: self.run(run_id), condition, seconds)

    @staticmethod
    def _until(fetch: Callable[[], Json], condition: Callable[[Json], bool], seconds: float) -> Json:
        deadline, pause = time.monotonic() + seconds, 0.01
        while not condition(job := fetch()):
            assert time.monotonic() < deadline, f"the job stays as {job}"
            time.sleep(pause)
            pause = min(1.2 * pause, 0.1)  # asking takes time from what is waited for
        return job

    def diagnose(self, dataset_id: str | None, **body: Any) -> Json:
        named = {"dataset_id": dataset_id} if dataset_id else {}
        answer = self.client.post("/v1/diagnoses", json=named | body)
        assert answer.status_code == 202, answer.text
        return dict(answer.json())

    def diagnosis(self, diagnosis_id: str) -> Json:
        return self.get(f"/v1/diagnoses/{diagnosis_id}")

    def until_diagnosis(self, diagnosis_id: str, condition: Callable[[Json], bool], seconds: float = 60.0) -> Json:
        return self._until(lambda: self.diagnosis(diagnosis_id), condition, seconds)

    def diagnosed(self, diagnosis_id: str, seconds: float = 60.0) -> Json:
        return self.until_diagnosis(diagnosis_id, lambda diagnosis: diagnosis["state"] in FINAL, seconds)

    def finish(self, run_id: str, seconds: float = 60.0) -> Json:
        return self.until(run_id, lambda run: run["state"] in FINAL, seconds)

    def history(self, run_id: str) -> list[Json]:
        return list(self.get(f"/v1/runs/{run_id}/history?limit=10000")["items"])


def metrics(client: httpx.Client, method: str = "GET", **headers: str) -> httpx.Response:
    """The answer of /v1/metrics, which on a busy machine may not be ready in time: then it is requested again."""
    deadline = time.monotonic() + 60
    while (answer := client.request(method, "/v1/metrics", headers=headers)).status_code == 503:
        assert time.monotonic() < deadline, answer.text
        time.sleep(0.2)
    return answer


As = Callable[[str], Api]


@contextmanager
def serving(app: FastAPI) -> Iterator[httpx.Client]:
    """Serve ``app`` on a free loopback port from a thread."""
    config = uvicorn.Config(
        app, port=0, loop="uvloop", http=Protocol, log_level="critical", timeout_graceful_shutdown=2
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        assert thread.is_alive(), "the application did not start"
        time.sleep(0.005)
    port = server.servers[0].sockets[0].getsockname()[1]
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60.0) as client:
            yield client
    finally:
        service = getattr(app.state, "service", None)
        if service is not None:
            service.begin_stop()
        server.should_exit = True
        thread.join(60.0)
        assert not thread.is_alive(), "the server does not stop"


@functools.cache
def _migrated() -> bytes:
    """A database that all migrations have made."""
    with TemporaryDirectory() as folder:
        Database(Path(folder)).close()
        return Path(folder, FILE_NAME).read_bytes()


def prepare(folder: Path) -> None:
    """Make a new data ``folder`` with a migrated database, since migrating is most of what starting costs.

    Folders that exist are left alone. Migrations have tests of their own (storage/test_database.py).
    """
    if not folder.exists():
        make_folder(folder)
        make_file(folder / FILE_NAME)
        (folder / FILE_NAME).write_bytes(_migrated())


@contextmanager
def toy_service(folder: Path, **settings: Any) -> Iterator[tuple[Service, Api]]:
    """A service that computes toys, and its API."""
    prepare(folder)
    app = create_app(
        Settings(data=folder, **settings),
        engine=toy.ToyEngine(),
        make_evaluator=toy.NoEvaluator,
        diagnoser=toy_diagnosis.ToyDiagnoser(),
    )
    with serving(app) as client:
        yield app.state.service, Api(client)


@pytest.fixture(scope="package")
def one_browser() -> Iterator[Browser]:
    """One for all tests, since it takes a second to start; they are skipped where there is none."""
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def browser(one_browser: Browser) -> Iterator[Browser]:
    """The browser, in which no page is left after the tests of a module."""
    yield one_browser
    for context in one_browser.contexts:
        context.close()


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data")


@pytest.fixture
def gate() -> Gate:
    """Asked for, it holds every generation of the toy search until the test lets it go."""
    return Gate()


@pytest.fixture
def engine(request: pytest.FixtureRequest) -> toy.ToyEngine:
    held = "gate" in request.fixturenames
    return toy.ToyEngine(gate=request.getfixturevalue("gate")) if held else toy.ToyEngine(seconds=0.01)


@pytest.fixture
def diagnoser(request: pytest.FixtureRequest) -> toy_diagnosis.ToyDiagnoser:
    held = "gate" in request.fixturenames
    return toy_diagnosis.ToyDiagnoser(gate=request.getfixturevalue("gate") if held else None)


def made(folder: Path, name: str, *scopes: str, owner: str = "") -> str:
    """The secret of a new key."""
    prepare(folder)
    database = Database(folder)
    with database.write() as session:
        _, secret = keys.make(session, name, owner or name, scopes)  # type: ignore[arg-type]
    database.close()
    return secret


@pytest.fixture
def secrets(settings: Settings) -> dict[str, str]:
    folder = settings.data
    return {
        "admin": made(folder, "admin", "admin"),
        "ann": made(folder, "ann", "read", "write"),
        "ann-reads": made(folder, "ann-reads", "read", owner="ann"),
        "bob": made(folder, "bob", "read", "write"),
    }


@pytest.fixture
def as_(client: httpx.Client, secrets: dict[str, str]) -> Iterator[As]:
    """The API as it answers to whom a key belongs."""
    opened = []

    def api(name: str) -> Api:
        headers = {"Authorization": f"Bearer {secrets[name]}"}
        opened.append(httpx.Client(base_url=client.base_url, headers=headers, timeout=60.0))
        return Api(opened[-1])

    yield api
    for one in opened:
        one.close()


@pytest.fixture
def client(
    request: pytest.FixtureRequest,
    settings: Settings,
    engine: toy.ToyEngine,
    diagnoser: toy_diagnosis.ToyDiagnoser,
) -> Iterator[httpx.Client]:
    if settings.keys:
        request.getfixturevalue("secrets")  # before the server has the folder
    prepare(settings.data)
    app = create_app(settings, engine=engine, make_evaluator=toy.NoEvaluator, diagnoser=diagnoser)
    with serving(app) as client:
        yield client


@pytest.fixture
def api(client: httpx.Client) -> Api:
    return Api(client)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Api, str]]:
    """One service for the requests of a module that change nothing, and the id of the dataset in it."""
    with toy_service(tmp_path_factory.mktemp("shared") / "data") as (_, api):
        yield api, str(api.upload()["id"])
