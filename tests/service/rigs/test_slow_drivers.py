"""Simulations that take longer than a driver may be silent."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

import wingfit
from tests.service.conftest import Json
from tests.service.rigs import decay_rig
from tests.service.rigs.test_drive import DECLARED, _result, _take, alone, client_of, service, upload, without_time
from wingfit import _drive
from wingfit.records.array_types import Array
from wingfit.rigs.run import Run
from wingfit.service.rigs import board

__all__ = ["alone"]  # a fixture
SILENT, LONG = 0.4, 1.5  # s


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board, "SILENT_SECONDS", SILENT)
    monkeypatch.setattr(_drive, "HEARD_SECONDS", 0.1)


def test_a_driver_that_computes_for_long_is_still_heard(tmp_path: Path, alone: Json) -> None:
    calls = 0

    def slow(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        nonlocal calls
        calls += 1
        if calls == 3:
            time.sleep(LONG)
        return decay_rig.simulate(genes, run)

    states = list[str]()
    with service(tmp_path) as api:
        one = api.diagnose(upload(api), rig=DECLARED)["id"]
        with client_of(api) as client:
            rig = replace(decay_rig.rig, simulate=slow)
            wingfit.drive(client, one, rig, on_work=lambda work: states.append(work["state"]))
        running = states[states.index("RUNNING") :]
        assert set(running) == {"RUNNING", "SUCCEEDED"}  # never back in the queue
        assert without_time(api.get(f"/v1/diagnoses/{one}/finding")) == alone


def test_a_late_result_is_kept_for_the_next_start(tmp_path: Path) -> None:
    with service(tmp_path) as api:
        one = api.diagnose(upload(api), rig=DECLARED)["id"]
        first = _take(api, one, "slow")
        assert first
        api.until_diagnosis(one, lambda now: now["state"] == "QUEUED")
        late = {"driver": "slow", "results": [_result(call) for call in first]}
        assert api.client.post(f"/v1/drive/{one}/results", json=late).json() == {"taken": len(first), "unknown": 0}
        again = _take(api, one, "slow")
        assert again
        assert not {call["id"] for call in first} & {call["id"] for call in again}
        api.client.post(f"/v1/diagnoses/{one}/cancel")
