"""Drivers give the numbers of a simulation in this process, also for experiments that were not recorded."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from tests.rigs.oscillator import RIG, blank, dataset
from wingfit._drive import _Simulator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.client.drive_answers import Simulation
from wingfit.records import Series
from wingfit.rigs.rig_model import RigModel, Simulated
from wingfit.service.jobs.job_kind import NotReadyError
from wingfit.service.rigs.driving import Driving
from wingfit.service.storage.database import Database
from wingfit.workers.in_process import InProcessEvaluator

TIMES = np.linspace(0.0, 2.0, 50)


def recording(name: str, mass: float, size: float) -> Series:
    push = size * np.sin(3.0 * TIMES)
    values = np.stack([np.sin(TIMES), np.cos(TIMES)], axis=1)
    return blank(name, samples=50, last=2.0, settings={"mass": mass}, inputs={"push": push}, values=values)


FIRST, SECOND = recording("first", 1.0, 0.5), recording("second", 2.0, 1.0)
PUSHED = replace(RIG, inputs={"push": "N"})
MODEL = RigModel(PUSHED, (FIRST, SECOND)).with_effects("dry_friction.slide")


def problem(*recordings: Series) -> Problem:
    return Problem(MODEL, recordings, MODEL.searched, base_genome(MODEL))


def individuals() -> np.ndarray:
    unit = np.random.default_rng(1).uniform(0.3, 0.7, (5, len(MODEL.genes)))
    return np.stack([gene.from_unit(column) for gene, column in zip(MODEL.genes, unit.T, strict=True)], axis=1)


@contextmanager
def driven(folder: Path) -> Iterator[Driving]:
    """A board whose simulations a thread computes, after a way through JSON."""
    database, simulator = Database(folder), _Simulator(PUSHED, dataset(FIRST, SECOND))
    driving, over = Driving(database), threading.Event()

    def drive() -> None:
        while not over.is_set():
            for call in driving.board.take("run_1", "one", 3):
                asked = cast(Simulation, json.loads(json.dumps(call.simulation())))
                result = json.loads(json.dumps(simulator.compute(asked)))
                channels = np.array(list(result["channels"].values())).T
                driving.settle("run_1", "one", {result["id"]: Simulated(channels, None)}, lambda _: True)
            over.wait(0.001)

    thread = threading.Thread(target=drive)
    thread.start()
    try:
        yield driving
    finally:
        over.set()
        thread.join(60)
        database.close()


CHANGED = replace(
    FIRST, settings={"mass": 2.0}, inputs={"push": 1.8125 * FIRST.inputs["push"]}
)  # a setting of the other recording, and a larger input


@pytest.mark.parametrize("recordings", [(FIRST, SECOND), (CHANGED,)], ids=["recorded", "changed"])
def test_numbers_are_those_of_one_process(tmp_path: Path, recordings: tuple[Series, ...]) -> None:
    asked, values = problem(*recordings), individuals()
    here = InProcessEvaluator().evaluate(asked, values, residuals=True)
    with driven(tmp_path) as driving:
        there = driving.evaluator("run_1").evaluate(asked, values, residuals=True)
        kept = driving.evaluator("run_1").evaluate(asked, values, residuals=True)  # from the database
    for found in (there, kept):
        assert found.reasons == here.reasons
        for one, other in zip(found.per_recording, here.per_recording, strict=True):
            np.testing.assert_array_equal(one.squares, other.squares)
            np.testing.assert_array_equal(one.residuals, other.residuals)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"times": TIMES + 0.5}, "other times"),
        ({"inputs": {"push": FIRST.inputs["push"] + 0.1}}, "another input 'push'"),
    ],
)
def test_what_a_driver_cannot_simulate_is_not_asked(tmp_path: Path, changes: dict[str, object], word: str) -> None:
    changed = replace(FIRST, **changes)  # type: ignore[arg-type]
    with driven(tmp_path) as driving, pytest.raises(ValueError, match=word):
        driving.evaluator("run_1").evaluate(problem(changed), individuals())


def test_a_job_without_a_driver_goes_back_to_the_queue(tmp_path: Path) -> None:
    database = Database(tmp_path)
    with pytest.raises(NotReadyError, match="its drivers are gone"):
        Driving(database).evaluator("run_1").evaluate(problem(FIRST), individuals())
    database.close()
