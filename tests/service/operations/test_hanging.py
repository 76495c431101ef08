"""A hanging worker delays neither a cancellation nor the stop of the service."""

# ruff: noqa: ARG002  they take what an evaluator takes

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import numpy as np
import numpy.typing as npt
import pytest

from tests.service import toy
from tests.service.conftest import Api, serving
from tests.workers import pendulum
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.calibration.search import CalibrationSpec, Generation
from wingfit.records import Dataset
from wingfit.service.app import create_app
from wingfit.service.jobs.interruptible import InterruptibleEvaluator
from wingfit.service.jobs.job_kind import InterruptedStepError
from wingfit.service.settings import Settings
from wingfit.workers import make_evaluator
from wingfit.workers.watch import never


class Hanging(toy.NoEvaluator):
    """An evaluator whose workers hang until the test ends."""

    def __init__(self) -> None:
        self.called, self.over = threading.Event(), threading.Event()

    def evaluate(
        self,
        problem: Problem,
        values: npt.ArrayLike,
        *,
        residuals: bool = False,
        interrupted: Callable[[], bool] = never,
    ) -> Evaluation:
        self.called.set()
        self.told = interrupted
        self.over.wait(60)
        raise RuntimeError("nobody waits for this any more")

    def close(self) -> None:
        self.over.set()


class Evaluating(toy.ToyEngine):
    """A toy search that evaluates before its first generation."""

    def calibrate(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None
    ) -> Iterator[Generation]:
        evaluator.evaluate(pendulum.problem(), pendulum.population(3))
        return super().calibrate(spec, dataset, evaluator, checkpoint)


@pytest.fixture
def hanging() -> Iterator[Hanging]:
    evaluator = Hanging()
    yield evaluator
    evaluator.over.set()


def _hung(client: httpx.Client, hanging: Hanging) -> tuple[Api, str]:
    """The API, and a run whose worker hangs."""
    api = Api(client)
    run: str = api.submit(api.upload()["id"])["id"]
    assert hanging.called.wait(60)
    return api, run


def test_a_cancelled_run_ends_though_its_worker_hangs(settings: Settings, hanging: Hanging) -> None:
    app = create_app(settings, engine=Evaluating(), make_evaluator=lambda: hanging)
    with serving(app) as client:
        api, run = _hung(client, hanging)
        began = time.monotonic()
        api.control(run, "cancel")
        assert api.finish(run, 30.0)["state"] == "CANCELLED"
        assert time.monotonic() - began < 30
        assert not hanging.over.is_set()
        assert hanging.told(), "what no worker has begun is not worth computing"


def test_the_service_stops_at_once_though_a_worker_hangs(
    settings: Settings, hanging: Hanging, caplog: pytest.LogCaptureFixture
) -> None:
    app = create_app(settings, engine=Evaluating(), make_evaluator=lambda: hanging)
    with serving(app) as client:
        _, run = _hung(client, hanging)
    assert "given up" not in caplog.text
    with serving(create_app(settings, engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)) as client:
        assert Api(client).finish(run)["state"] == "SUCCEEDED"


def test_uninterrupted_evaluations_are_unchanged() -> None:
    evaluator = make_evaluator("in_process")
    problem, values = pendulum.problem(), pendulum.population(9)
    plain = evaluator.evaluate(problem, values, residuals=True)
    got = InterruptibleEvaluator(evaluator, lambda: False).evaluate(problem, values, residuals=True)
    assert all(
        np.array_equal(a.squares, b.squares) for a, b in zip(got.per_recording, plain.per_recording, strict=True)
    )
    assert got.per_recording[0].residuals is not None


def test_an_error_of_the_model_arrives_as_it_was() -> None:
    evaluator = InterruptibleEvaluator(make_evaluator("in_process"), lambda: False)
    with pytest.raises(ValueError, match="cannot simulate"):
        evaluator.evaluate(pendulum.problem(pendulum.refuse), pendulum.population(3))


def test_nothing_starts_after_an_interruption(hanging: Hanging) -> None:
    with pytest.raises(InterruptedStepError):
        InterruptibleEvaluator(hanging, lambda: True).evaluate(pendulum.problem(), pendulum.population(3))
    assert not hanging.called.is_set()
