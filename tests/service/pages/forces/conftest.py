"""The page of runs on forces: a real service with forces of the virtual balance, and a run that has finished."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.service.conftest import Api, serving
from tests.service.pages.browsing import Seen
from tests.service.runs import force_data
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.workers import make_evaluator

if TYPE_CHECKING:
    from playwright.sync_api import Browser

PATIENCE = 120.0


@pytest.fixture(scope="package")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    settings = Settings(data=tmp_path_factory.mktemp("page") / "data")
    with serving(create_app(settings, make_evaluator=lambda: make_evaluator("in_process", None, None))) as client:
        yield Api(client)


@pytest.fixture
def seen(browser: Browser, api: Api) -> Iterator[Seen]:
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    seen = Seen.watched(context.new_page(), base(api))
    yield seen
    context.close()
    assert seen.foreign == []


@pytest.fixture(scope="package")
def dataset(api: Api) -> dict[str, Any]:
    answer = api.client.post("/v1/datasets", files={"file": ("delfly.zip", force_data.archive())})
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


@pytest.fixture(scope="package")
def local(api: Api, dataset: dict[str, Any]) -> str:
    return finished(api, dataset)


@pytest.fixture(scope="package")
def result(api: Api, local: str) -> dict[str, Any]:
    return api.get(f"/v1/runs/{local}/result")


def base(api: Api) -> str:
    return str(api.client.base_url).rstrip("/")


def submitted(api: Api, dataset: dict[str, Any], **body: Any) -> str:
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset["id"]} | body)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def finished(api: Api, dataset: dict[str, Any], **body: Any) -> str:
    run_id = submitted(api, dataset, **body)
    run = api.finish(run_id, PATIENCE)
    assert run["state"] == "SUCCEEDED", run["error"]
    return run_id
