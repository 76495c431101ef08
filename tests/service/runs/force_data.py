"""Small force datasets of the virtual balance, and a server that calibrates on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.service.conftest import Api, serving
from wingfit.records import Dataset, save_dataset
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.sim.virtual_rigs.balance import TRIALS, Balance, campaign
from wingfit.workers import make_evaluator

Json = dict[str, Any]
TRUTH = {trial.name: trial.coefficients for trial in TRIALS}
BALANCE = Balance(every=10, beats=4)
HELD_OUT = "test-7"
FITTED = ("test-3", "test-4", "test-5", "test-6", "test-8")


@cache
def dataset() -> Dataset:
    """Six conditions of the source's Table 4, one of them held out, four beats each."""
    return campaign(3, BALANCE, TRIALS[2:], (HELD_OUT,))


@cache
def archive(fewer: int = 0) -> bytes:
    """The dataset as a zip, without its ``fewer`` first recordings."""
    whole = dataset()
    return zipped(replace(whole, recordings=whole.recordings[fewer:]))


def zipped(given: Dataset) -> bytes:
    """``given`` as the bytes of a zip."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "delfly.zip"
        save_dataset(given, path)
        return path.read_bytes()


def served(folder: Path) -> Iterator[Api]:
    """A server with the real engine, whose data are in ``folder``."""
    app = create_app(Settings(data=folder / "data"), make_evaluator=lambda: make_evaluator("in_process", None, None))
    with serving(app) as client:
        yield Api(client)


def upload(api: Api, data: bytes) -> Json:
    """The dataset as uploaded."""
    answer = api.client.post("/v1/datasets", files={"file": ("delfly.zip", data)})
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


def finished(api: Api, dataset: Json, **body: Any) -> Json:
    """A run on ``dataset`` that has succeeded."""
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset["id"]} | body)
    assert answer.status_code == 202, answer.text
    run = api.finish(answer.json()["id"], 120.0)
    assert run["state"] == "SUCCEEDED", run["error"]
    return run
