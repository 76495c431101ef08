"""Every evaluator gives identical numbers, and reports failures of models and workers in the same way."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from tests.workers import pendulum
from wingfit.calibration.evaluator import distinct, gather, run_unit, units
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.workers import (
    EvaluationInterruptedError,
    EvaluatorClosedError,
    EvaluatorKind,
    RunningEvaluator,
    WorkerLostError,
    make_evaluator,
)
from wingfit.workers.in_process import InProcessEvaluator
from wingfit.workers.ray_batches import UNDER_WAY, UNKNOWN_TASKS
from wingfit.workers.share import Task
from wingfit.workers.watch import ATTEMPTS

KINDS: tuple[EvaluatorKind, ...] = ("in_process", "processes", "ray")
DISTRIBUTED: tuple[EvaluatorKind, ...] = ("processes", "ray")


@pytest.fixture(scope="module")
def made() -> Iterator[Callable[[EvaluatorKind], RunningEvaluator]]:
    """Evaluators with two workers, started when first asked for and shared by the tests of this module."""
    running: dict[EvaluatorKind, RunningEvaluator] = {}

    def get(kind: EvaluatorKind) -> RunningEvaluator:
        if kind not in running:
            running[kind] = make_evaluator(kind, 2)
        return running[kind]

    yield get
    for evaluator in running.values():
        evaluator.close()


@pytest.fixture(params=KINDS)
def any_evaluator(
    request: pytest.FixtureRequest, made: Callable[[EvaluatorKind], RunningEvaluator]
) -> RunningEvaluator:
    return made(request.param)


@pytest.fixture(params=DISTRIBUTED)
def distributed(request: pytest.FixtureRequest, made: Callable[[EvaluatorKind], RunningEvaluator]) -> RunningEvaluator:
    return made(request.param)


def reference(problem: Problem, values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Evaluation:
    done = [run_unit(problem, values, unit, residuals=True) for unit in units(problem, len(values))]
    return gather(problem, done)


def assert_same_bits(got: Evaluation, wanted: Evaluation) -> None:
    assert len(got.per_recording) == len(wanted.per_recording)
    for a, b in zip(got.per_recording, wanted.per_recording, strict=True):
        assert a.squares.tobytes() == b.squares.tobytes()
        assert a.distance.tobytes() == b.distance.tobytes()
        assert (a.samples, a.reasons) == (b.samples, b.reasons)
        assert a.residuals is not None
        assert b.residuals is not None
        assert a.residuals.tobytes() == b.residuals.tobytes()


@pytest.mark.parametrize("individuals", [1, 8, 53])
def test_same_bits_everywhere(any_evaluator: RunningEvaluator, individuals: int) -> None:
    problem, values = pendulum.problem(), pendulum.population(individuals)
    wanted = reference(problem, values)
    assert_same_bits(any_evaluator.evaluate(problem, values, residuals=True), wanted)
    assert wanted.reasons[0] == "overdamped"
    assert wanted.fitness[0] == np.inf
    assert all(np.isfinite(wanted.fitness[1:]))


def test_equal_individuals_are_simulated_once(any_evaluator: RunningEvaluator) -> None:
    problem, values = pendulum.problem(), pendulum.population(11)
    values = values[[3, 0, 3, 7, 0, 10, 3, 3]]
    assert_same_bits(any_evaluator.evaluate(problem, values, residuals=True), reference(problem, values))
    rows, place = distinct(problem, values)
    assert (rows[place] == values).all()
    assert (len(rows), place) == (4, [0, 1, 0, 2, 1, 3, 0, 0])


def test_only_distinct_individuals_become_work(monkeypatch: pytest.MonkeyPatch) -> None:
    evaluator, rows = InProcessEvaluator(), []
    monkeypatch.setattr(Task, "run", lambda task, *_, **__: rows.append(len(task.values)))
    monkeypatch.setattr("wingfit.workers.running_evaluator.gather", lambda *_: Evaluation(()))
    evaluator.evaluate(pendulum.problem(), np.repeat(pendulum.population(3), 20, axis=0))
    assert set(rows) == {3}


def test_residuals_only_on_request(any_evaluator: RunningEvaluator) -> None:
    evaluation = any_evaluator.evaluate(pendulum.problem(), pendulum.population(3))
    assert all(part.residuals is None for part in evaluation.per_recording)


def test_has_kind_and_workers(any_evaluator: RunningEvaluator) -> None:
    assert any_evaluator.kind in KINDS
    assert any_evaluator.workers == (1 if any_evaluator.kind == "in_process" else 2)


def test_two_threads_with_different_problems(any_evaluator: RunningEvaluator) -> None:
    problems = [pendulum.problem(gravities=(9.81, 3.7)), pendulum.problem(gravities=(1.62,))]
    populations = [pendulum.population(40, seed) for seed in (1, 2)]
    wanted = [reference(p, v) for p, v in zip(problems, populations, strict=True)]
    results: list[list[Evaluation]] = [[], []]

    def work(i: int) -> None:
        for _ in range(3):
            results[i].append(any_evaluator.evaluate(problems[i], populations[i], residuals=True))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    for got, want in zip(results, wanted, strict=True):
        assert len(got) == 3
        for evaluation in got:
            assert_same_bits(evaluation, want)


def test_more_problems_than_a_worker_remembers(distributed: RunningEvaluator) -> None:
    problems = [pendulum.problem(gravities=(g,)) for g in np.linspace(1.0, 10.0, 11).tolist()]
    values = pendulum.population(5)
    for problem in (*problems, *problems):
        assert_same_bits(distributed.evaluate(problem, values, residuals=True), reference(problem, values))


def test_an_exception_of_the_model_is_passed_on(any_evaluator: RunningEvaluator) -> None:
    with pytest.raises(ValueError, match=r"^cannot simulate g9\.81"):
        any_evaluator.evaluate(pendulum.problem(pendulum.refuse, (9.81,)), pendulum.population(3))
    problem, values = pendulum.problem(), pendulum.population(3)
    assert_same_bits(any_evaluator.evaluate(problem, values, residuals=True), reference(problem, values))


def test_a_model_that_cannot_be_pickled_is_an_error(distributed: RunningEvaluator) -> None:
    with pytest.raises(Exception, match="pickle"):
        distributed.evaluate(pendulum.problem(lambda *_: None), pendulum.population(3))


def test_kernels_get_arrays_of_the_type_they_were_compiled_for(any_evaluator: RunningEvaluator) -> None:
    any_evaluator.evaluate(pendulum.problem(pendulum.need_writeable), pendulum.population(9))


def test_survives_the_death_of_a_worker(distributed: RunningEvaluator, tmp_path: Path) -> None:
    problem, values = pendulum.problem(pendulum.DieOnce(tmp_path / "died")), pendulum.population(50)
    got = distributed.evaluate(problem, values, residuals=True)
    assert (tmp_path / "died").exists()
    assert_same_bits(got, reference(pendulum.problem(), values))


def test_an_interrupted_call_drops_units_that_have_not_started(any_evaluator: RunningEvaluator, tmp_path: Path) -> None:
    problem, values = pendulum.problem(pendulum.Count(tmp_path, 0.2)), pendulum.population(400)  # 150 units

    def begun() -> int:
        return sum(1 for _ in tmp_path.iterdir())

    with pytest.raises(EvaluationInterruptedError):
        any_evaluator.evaluate(problem, values, interrupted=lambda: begun() > 0)
    before = -1
    while before != (before := begun()):
        time.sleep(1.0)
    assert 0 < before <= 2 * UNDER_WAY * UNKNOWN_TASKS + 2
    other, values = pendulum.problem(), pendulum.population(3)
    assert_same_bits(any_evaluator.evaluate(other, values, residuals=True), reference(other, values))


def test_an_error_of_rays_memory_is_not_an_error_of_the_model(
    distributed: RunningEvaluator, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    if distributed.kind != "ray":
        pytest.skip("a pool of processes has no such memory")
    problem, values = pendulum.problem(pendulum.LoseOnce(tmp_path / "lost")), pendulum.population(20)
    with caplog.at_level(logging.WARNING, logger="wingfit.workers"):
        got = distributed.evaluate(problem, values, residuals=True)
    assert_same_bits(got, reference(pendulum.problem(), values))
    (record,) = caplog.records
    assert "GetTimeoutError: the problem did not come" in record.getMessage()


def test_a_unit_that_always_kills_its_worker_is_given_up(distributed: RunningEvaluator) -> None:
    with pytest.raises(WorkerLostError, match="fewer workers than 2"):
        distributed.evaluate(pendulum.problem(pendulum.die_always, (9.81,)), pendulum.population(3))
    problem, values = pendulum.problem(), pendulum.population(3)
    assert_same_bits(distributed.evaluate(problem, values, residuals=True), reference(problem, values))


def test_a_death_before_the_start_is_not_blamed_on_the_unit(tmp_path: Path) -> None:
    others = set(_workers())
    evaluator = make_evaluator("processes", 1)
    try:
        problem, values = pendulum.problem(pendulum.Note(tmp_path), (9.81,)), pendulum.population(3)
        killed: set[int] = set()
        with ThreadPoolExecutor(1) as thread:
            asked = thread.submit(evaluator.evaluate, problem, values, residuals=True)
            # More of them than a unit may kill; starting takes far longer than it takes to notice one.
            while len(killed) < ATTEMPTS + 2 and not asked.done():
                for pid in set(_workers()) - others - killed:
                    os.kill(pid, signal.SIGKILL)
                    killed.add(pid)
                time.sleep(0.005)
            got = asked.result(60.0)
    finally:
        evaluator.close()
    assert len(killed) == ATTEMPTS + 2
    assert_same_bits(got, reference(pendulum.problem(None, (9.81,)), values))


def _workers() -> list[int]:
    """Living processes of the evaluators of this one."""
    with suppress(ValueError):  # one that is being let go of just now
        return [one.pid for one in multiprocessing.active_children() if one.name == "wingfit-worker" and one.pid]
    return []


def test_workers_have_low_priority_and_one_thread(distributed: RunningEvaluator, tmp_path: Path) -> None:
    distributed.evaluate(pendulum.problem(pendulum.Note(tmp_path, 0.05)), pendulum.population(32))
    notes = [note.read_text().split() for note in tmp_path.iterdir()]
    assert len(notes) == 2
    for niceness, threads, *_ in notes:
        assert int(niceness) >= 10
        assert threads == "1"


@pytest.mark.parametrize("kind", KINDS)
def test_closing_ends_a_call_in_progress(kind: EvaluatorKind, tmp_path: Path) -> None:
    # In a process of its own, since one process can have one connection to Ray.
    code = f"""
import threading, time
from pathlib import Path
from tests.workers import pendulum
from wingfit.workers import EvaluatorClosedError, make_evaluator

population = pendulum.population(400)

def call():
    try:
        evaluator.evaluate(pendulum.problem(pendulum.Note(Path({str(tmp_path)!r}), 0.5)), population)
    except EvaluatorClosedError as error:
        print("closed:", error)

if __name__ == "__main__":
    evaluator = make_evaluator({kind!r}, 2)
    thread = threading.Thread(target=call)
    thread.start()
    while not any(Path({str(tmp_path)!r}).iterdir()):
        time.sleep(0.05)
    began = time.monotonic()
    evaluator.close()
    evaluator.close()
    thread.join(60)
    # The work itself takes 400 / 8 * 3 * 0.5 s / 2 = 37.5 s.
    print("alive" if thread.is_alive() else "ended", time.monotonic() - began < 30)
    call()
"""
    script = tmp_path.with_suffix(".py")
    script.write_text(code)
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=180, env=environment(), check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [message(kind), "ended True", message(kind)]


def message(kind: str) -> str:
    return f"closed: {EvaluatorClosedError(kind)}"


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}


def test_only_the_ray_evaluator_imports_ray() -> None:
    code = "import sys, wingfit.workers.processes as p; p.ProcessPoolEvaluator(1).close(); print('ray' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment(), check=True)
    assert done.stdout.strip() == "False"


def test_invalid_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="workers is 0; it must be at least 1"):
        make_evaluator("processes", 0)
    with pytest.raises(ValueError, match="needs the evaluator 'ray'"):
        make_evaluator("processes", address="127.0.0.1:6379")
    with pytest.raises(ValueError, match="'ray://head:10001'; write host:port"):
        make_evaluator("ray", address="ray://head:10001")
    with pytest.raises(ValueError, match="unknown evaluator 'dask'; give one of in_process, processes, ray"):
        make_evaluator("dask")  # type: ignore[arg-type]
