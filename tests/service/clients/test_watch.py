"""Watching a job while the server starts: the start is of interest only to a job that waits for it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from wingfit.cli import jobs
from wingfit.cli.diagnose import DIAGNOSES
from wingfit.cli.jobs import JobKind, follow
from wingfit.cli.runs import RUNS
from wingfit.client.client import Client


class Starting:
    """A server that starts for ever, with a job that is in one of ``states`` after the other."""

    def __init__(self, states: Iterable[str]) -> None:
        self._states: Iterator[str] = iter(states)
        self.looks = 0

    def health(self) -> dict[str, str]:
        self.looks += 1
        return {"status": "starting", "detail": "compiling the simulator, once: 25%"}

    def fetch(self, *_: Any) -> dict[str, str]:
        return {"state": next(self._states)}


def watched(kind: JobKind, server: Starting) -> Any:
    waits = replace(kind, fetch=server.fetch, wait=lambda *_: "the job")
    return follow(server, waits, "id")  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [RUNS, DIAGNOSES])
@pytest.mark.parametrize("state", ["SUCCEEDED", "FAILED", "CANCELLED", "PAUSED"])
def test_a_job_that_is_not_active_does_not_wait_for_the_start(kind: JobKind, state: str) -> None:
    server = Starting([state])
    assert watched(kind, server) == "the job"
    assert server.looks == 0


def test_a_job_that_ends_meanwhile_waits_no_longer(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(jobs, "START_SECONDS", 0.0)
    server = Starting(["QUEUED", "RUNNING", "CANCELLED"])
    assert watched(RUNS, server) == "the job"
    assert server.looks == 2
    assert "compiling the simulator, once: 25%" in capsys.readouterr().err


def test_each_kind_of_job_is_fetched_as_itself() -> None:
    assert (RUNS.fetch, DIAGNOSES.fetch) == (Client.run, Client.diagnosis)
