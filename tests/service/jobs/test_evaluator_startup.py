"""The thread that starts the evaluator goes on whatever happens before the first attempt."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

import pytest

from tests.service import toy
from wingfit.service.jobs.evaluator_startup import Pool, Prepare
from wingfit.sim import warm
from wingfit.workers import compiling


class Started:
    """A pool that has started; ``before`` is what it said that it did when the first attempt began."""

    def __init__(self, prepare: Prepare) -> None:
        ready = threading.Event()
        self.before: str | None = None
        self.pool = Pool(self._make, lambda _: ready.set(), prepare)
        self.pool.start()
        assert ready.wait(30), f"the evaluator did not start: {self.pool.status}, {self.pool.detail}"

    def _make(self) -> toy.NoEvaluator:
        self.before = self.pool.detail
        return toy.NoEvaluator()

    def is_well(self) -> None:
        """The evaluator runs, and nothing is said about what was done before."""
        assert (self.pool.status, self.pool.detail, self.before) == ("ok", None, None)
        assert self.pool.close()


def saying(say: Callable[[str], None], _: Callable[[], bool]) -> None:
    say("compiling the simulator, once: 99%")


def failing(say: Callable[[str], None], _: Callable[[], bool]) -> None:
    say("compiling the simulator, once: 25%")
    raise OSError("no process can be started")


def test_what_was_done_is_not_said_any_more_when_the_attempts_begin(caplog: pytest.LogCaptureFixture) -> None:
    Started(saying).is_well()
    assert "cannot prepare" not in caplog.text


def test_a_failure_before_the_first_attempt_is_logged_and_the_evaluator_starts(
    caplog: pytest.LogCaptureFixture,
) -> None:
    Started(failing).is_well()
    assert "cannot prepare the start of the evaluator" in caplog.text
    assert "OSError: no process can be started" in caplog.text


@pytest.mark.parametrize(
    ("executable", "command"),
    [
        (sys.executable, "import time; print('Warning: something', flush=True); time.sleep(0.5)"),
        (sys.executable, r"import os, time; os.write(1, b'\xff 0.5\n'); time.sleep(0.5)"),
        ("/no/such/python", ""),
    ],
)
def test_the_evaluator_starts_whatever_compiling_prints_and_if_it_cannot_run(
    monkeypatch: pytest.MonkeyPatch, executable: str, command: str
) -> None:
    monkeypatch.setattr(warm, "compiled", lambda: False)
    monkeypatch.setattr(compiling, "COMMAND", command)
    monkeypatch.setattr(sys, "executable", executable)
    Started(compiling.compile_simulator).is_well()
