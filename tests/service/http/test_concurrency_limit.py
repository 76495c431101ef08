"""Few simulations and uploads at a time, and reads do not wait for them."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from tests.service import toy
from tests.service.conftest import Api, serving
from wingfit.calibration.result import Comparison
from wingfit.calibration.search import CalibrationSpec
from wingfit.records import Dataset
from wingfit.service.app import create_app
from wingfit.service.http.concurrency_limit import SIMULATIONS, UPLOADS, ConcurrencyLimit
from wingfit.service.http.problems import ProblemError
from wingfit.service.settings import Settings


class HeldEngine(toy.ToyEngine):
    """Its simulations last until they are let go."""

    def __init__(self) -> None:
        super().__init__()
        self.entered, self.go = threading.Semaphore(0), threading.Event()

    def compare(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
    ) -> Comparison:
        self.entered.release()
        assert self.go.wait(60)
        return super().compare(spec, dataset, genome, recording)


def test_reading_goes_on_while_simulations_wait(tmp_path: Path) -> None:
    engine, crowd = HeldEngine(), 50  # more than the threads that answer
    with serving(create_app(Settings(data=tmp_path), engine=engine, make_evaluator=toy.NoEvaluator)) as client:
        api = Api(client)
        run = api.submit(api.upload()["id"])["id"]
        api.finish(run)

        def simulate(_: int) -> int:
            with httpx.Client(base_url=client.base_url, timeout=90) as one:
                return one.get(f"/v1/runs/{run}/comparison").status_code

        with ThreadPoolExecutor(crowd) as pool:
            asked = [pool.submit(simulate, k) for k in range(crowd)]
            for _ in range(SIMULATIONS):
                assert engine.entered.acquire(timeout=60)
            for _ in range(20):
                assert client.get("/v1/runs", timeout=60).status_code == 200
            assert not engine.entered.acquire(timeout=0.2)  # no more at once
            engine.go.set()
            assert {one.result() for one in asked} == {200}


class HeldReader(toy.ToyEngine):
    """Its reading of an upload lasts until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.entered, self.go = threading.Semaphore(0), threading.Event()

    def load(self, data: bytes, filename: str) -> Dataset:
        self.entered.release()
        assert self.go.wait(60)
        return super().load(data, filename)


def test_few_uploads_are_read_concurrently(tmp_path: Path) -> None:
    engine, crowd = HeldReader(), UPLOADS + 4
    with serving(create_app(Settings(data=tmp_path), engine=engine, make_evaluator=toy.NoEvaluator)) as client:

        def upload(_: int) -> int:
            with httpx.Client(base_url=client.base_url, timeout=90) as one:
                return one.post("/v1/datasets", files={"file": ("a.zip", toy.archive())}).status_code

        with ThreadPoolExecutor(crowd) as pool:
            asked = [pool.submit(upload, k) for k in range(crowd)]
            for _ in range(UPLOADS):
                assert engine.entered.acquire(timeout=60)
            assert not engine.entered.acquire(timeout=0.2)  # no more at once
            assert client.get("/v1/datasets", timeout=60).status_code == 200
            engine.go.set()
            assert {one.result() for one in asked} == {201}


def test_too_many_waiting_requests_get_a_503() -> None:
    async def scene() -> None:
        limit, release = ConcurrencyLimit("simulations", 1, max_waiting=2), asyncio.Semaphore(0)

        async def request() -> None:
            async with limit.slot():
                await release.acquire()

        first = asyncio.create_task(request())
        await asyncio.sleep(0)
        waiting = [asyncio.create_task(request()) for _ in range(2)]
        await asyncio.sleep(0)
        with pytest.raises(ProblemError, match="2 simulations are waiting, the maximum"):
            await request()
        waiting[0].cancel()  # a request that is cancelled while it waits makes room for another
        await asyncio.sleep(0)
        late = asyncio.create_task(request())
        for _ in range(3):
            release.release()
        await asyncio.wait_for(asyncio.gather(first, waiting[1], late), 1)

    asyncio.run(scene())
