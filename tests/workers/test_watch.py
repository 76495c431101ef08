"""Hung workers are detected, counted and replaced, and their units are repeated."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contract.test_evaluators import DISTRIBUTED, assert_same_bits, environment, reference
from tests.workers import pendulum
from wingfit.workers import EvaluatorKind, RunningEvaluator, WorkerLostError, make_evaluator, watch
from wingfit.workers.watch import (
    ENOUGH,
    FACTOR,
    FIRST_SECONDS,
    NEW_SECONDS,
    SLACK_SECONDS,
    Expectation,
    Standing,
    Tally,
)


@pytest.fixture(params=DISTRIBUTED, scope="module")
def distributed(request: pytest.FixtureRequest) -> Iterator[RunningEvaluator]:
    kind: EvaluatorKind = request.param
    evaluator = make_evaluator(kind, 2)
    yield evaluator
    evaluator.close()


def warmed(evaluator: RunningEvaluator) -> None:
    """Start all workers."""
    evaluator.evaluate(pendulum.problem(), pendulum.population(64))


def short(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """Units of a new problem hang after ``seconds``."""
    for name in ("FIRST_SECONDS", "NEW_SECONDS", "SLACK_SECONDS"):
        monkeypatch.setattr(watch, name, seconds)
    monkeypatch.setattr(watch, "FACTOR", 0.0)


@pytest.mark.parametrize("how", ["stop", "loop", "sleep"])
def test_a_hung_worker_is_replaced(
    distributed: RunningEvaluator,
    how: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    warmed(distributed)
    short(monkeypatch, 2.0)
    before, began = distributed.standing, time.monotonic()
    problem, values = pendulum.problem(pendulum.HangOnce(tmp_path / "hung", how)), pendulum.population(50)
    with caplog.at_level(logging.WARNING, logger="wingfit.workers"):
        got = distributed.evaluate(problem, values, residuals=True)
    assert time.monotonic() - began < 60
    assert_same_bits(got, reference(pendulum.problem(), values))
    after = distributed.standing
    assert (after.hung - before.hung, after.restarts - before.restarts) == (1, 1)
    (record,) = caplog.records
    assert "took more than 2 s" in record.getMessage()
    assert "against recording" in record.getMessage() or "recordings" in record.getMessage()
    warmed(distributed)
    assert distributed.standing.workers == 2


def test_a_unit_that_always_hangs_is_given_up(distributed: RunningEvaluator, monkeypatch: pytest.MonkeyPatch) -> None:
    warmed(distributed)
    short(monkeypatch, 0.05)
    with pytest.raises(WorkerLostError, match="one after the other"):
        distributed.evaluate(pendulum.problem(pendulum.hang_always, (9.81,)), pendulum.population(3))
    monkeypatch.undo()
    warmed(distributed)


def test_a_slow_unit_is_finished_in_the_end(
    distributed: RunningEvaluator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    warmed(distributed)
    short(monkeypatch, 0.5)
    problem = pendulum.problem(pendulum.Note(tmp_path, 1.5), (9.81,))
    values = pendulum.population(3)
    got = distributed.evaluate(problem, values, residuals=True)
    assert_same_bits(got, reference(pendulum.problem(None, (9.81,)), values))


def test_a_stopped_idle_worker_is_replaced(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    evaluator = make_evaluator("processes", 1)
    try:
        evaluator.evaluate(pendulum.problem(pendulum.Note(tmp_path)), pendulum.population(3))
        (pid,) = [int(note.name) for note in tmp_path.iterdir()]
        os.kill(pid, signal.SIGSTOP)
        short(monkeypatch, 2.0)
        values = pendulum.population(9)
        with caplog.at_level(logging.WARNING, logger="wingfit.workers"):
            got = evaluator.evaluate(pendulum.problem(), values, residuals=True)
        assert_same_bits(got, reference(pendulum.problem(), values))
        assert evaluator.standing == Standing(1, 0, 1, 1)
        assert f"worker process {pid} hung before starting 8 individuals" in caplog.text
    finally:
        evaluator.close()


def test_a_dead_worker_is_not_counted_as_living(tmp_path: Path) -> None:
    evaluator = make_evaluator("processes", 2)
    try:
        evaluator.evaluate(pendulum.problem(pendulum.Note(tmp_path, 0.05)), pendulum.population(64))
        pids = [int(note.name) for note in tmp_path.iterdir()]
        assert evaluator.standing == Standing(2)
        os.kill(pids[0], signal.SIGKILL)
        deadline = time.monotonic() + 60
        while evaluator.standing.workers == 2 and time.monotonic() < deadline:
            time.sleep(0.01)
        assert evaluator.standing == Standing(1)
        warmed(evaluator)
        assert evaluator.standing == Standing(2, 1, 0, 1)
    finally:
        evaluator.close()


def expecting(**seconds: list[float]) -> Expectation:
    expected = Expectation()
    for key, each in seconds.items():
        for one in each:
            expected.done(key, one)
    return expected


def test_the_time_limit_follows_from_finished_units() -> None:
    expected = expecting(a=[0.5, 0.4, 200.0, 0.6, 0.5])  # one compiled kernels
    assert expected.limit("a") == SLACK_SECONDS + FACTOR * 0.5
    assert expected.limit("a", 3) == 8 * expected.limit("a")
    for _ in range(watch.UNITS_REMEMBERED):
        expected.done("a", 2.0)
    assert expected.limit("a") == SLACK_SECONDS + FACTOR * 2.0, "the last ones count"


def test_a_new_problem_gets_more_time_than_one_that_is_known() -> None:
    assert Expectation().limit("a") == FIRST_SECONDS
    assert expecting(a=[0.001] * (ENOUGH - 1)).limit("a") == FIRST_SECONDS
    quick = expecting(a=[0.001] * ENOUGH)
    assert quick.limit("a") < quick.limit("b") == NEW_SECONDS < FIRST_SECONDS
    slow = expecting(a=[0.001] * ENOUGH, c=[3.0] * ENOUGH)
    assert slow.limit("b") == slow.limit("c") == SLACK_SECONDS + FACTOR * 3.0 > NEW_SECONDS
    assert slow.limit("a") == quick.limit("a")


def test_the_most_recent_problems_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch, "PROBLEMS_REMEMBERED", 3)
    expected = Expectation()
    for key in "abcad":
        for _ in range(ENOUGH):
            expected.done(key, 1e-3)
    quick = SLACK_SECONDS + FACTOR * 1e-3
    assert [key for key in "abcd" if expected.limit(key) == quick] == ["a", "c", "d"]


def test_counts_add_up() -> None:
    tally = Tally()
    tally.replaced("died")
    tally.replaced("hung")
    tally.replaced("hung")
    assert tally.standing(4) == Standing(4, 1, 2, 3)


GUARDED = """
import os, signal, sys, time
from wingfit.workers.guardian import Guardian
guardian = Guardian(silence_s=float(sys.argv[2]), beat_s=0.2)
with guardian.watching(float(sys.argv[3])):
    time.sleep(0.1)
    if sys.argv[1] == "stop":
        os.kill(os.getpid(), signal.SIGSTOP)
    if sys.argv[1] == "overdue":
        time.sleep(60)
time.sleep(1.5)
print(guardian._process.pid)
"""


@pytest.mark.parametrize(
    ("what", "silence", "limit", "ends"),
    [("overdue", 60, 0.5, -9), ("stop", 60, 0.5, -9), ("stop", 1, 60, -9), ("quick", 1, 0.5, 0)],
)
def test_the_guardian_kills_its_parent_only_if_it_hangs(what: str, silence: float, limit: float, ends: int) -> None:
    command = [sys.executable, "-c", GUARDED, what, str(silence), str(limit)]
    done = subprocess.run(command, timeout=60, check=False, env=environment(), capture_output=True, text=True)
    assert done.returncode == ends, done.stderr
    if not ends:  # and ends with it
        deadline = time.monotonic() + 60
        while Path(f"/proc/{done.stdout.strip()}").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not Path(f"/proc/{done.stdout.strip()}").exists()
