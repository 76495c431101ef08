"""A job during which the server has ended is computed alone, also when it was paused in between; none is stuck."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sqlalchemy import update

from tests.service import toy
from tests.service.conftest import Api, serving, toy_service
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.search import CalibrationSpec, Generation
from wingfit.records import Dataset
from wingfit.service.app import create_app
from wingfit.service.container import Service
from wingfit.service.settings import Settings
from wingfit.service.storage.tables import RunRow
from wingfit.workers.jobs import MOST_STARTS


class Crowd(toy.ToyEngine):
    """A toy search that notes who is computed beside whom, by their seeds."""

    def __init__(self) -> None:
        super().__init__(seconds=0.02)
        self.lock, self.now = threading.Lock(), set[int]()
        self.seen: list[frozenset[int]] = []

    def calibrate(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None
    ) -> Iterator[Generation]:
        with self.lock:
            self.now.add(spec.seed)
            self.seen.append(frozenset(self.now))
        try:
            yield from super().calibrate(spec, dataset, evaluator, checkpoint)
        finally:
            with self.lock:
                self.now.remove(spec.seed)


def _change(service: Service, run: str, **columns: Any) -> None:
    with service.database.write() as session:
        session.execute(update(RunRow).where(RunRow.id == run).values(**columns))


def test_a_suspect_that_was_paused_still_begins_alone(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path, max_runs=2), engine=(crowd := Crowd()), make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        api = Api(client)
        dataset = api.upload()["id"]
        for seed, generations in ((1, 20), (2, 60)):
            api.submit(dataset, seed=seed, max_generations=generations)
        suspect = api.submit(dataset, seed=3)["id"]
        api.control(suspect, "pause")
        _change(app.state.service, suspect, starts=MOST_STARTS - 1)
        api.control(suspect, "resume")
        behind = api.submit(dataset, seed=4)["id"]
        assert api.finish(suspect)["state"] == api.finish(behind)["state"] == "SUCCEEDED"
    assert {1, 2} in crowd.seen
    # Once it has got on, others may join it.
    assert next(together for together in crowd.seen if 3 in together) == {3}


def test_a_run_whose_end_could_not_be_stored_can_be_cancelled(tmp_path: Path) -> None:
    with toy_service(tmp_path) as (service, api):
        run = api.submit(api.upload()["id"])["id"]
        api.finish(run)
        deadline = time.monotonic() + 60
        while service.runner.under_way() and time.monotonic() < deadline:
            time.sleep(0.01)
        _change(service, run, state="RUNNING")
        assert api.control(run, "cancel")["state"] == "CANCELLED"
