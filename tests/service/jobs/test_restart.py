"""Whatever ends the server, nothing that it acknowledged is lost, and runs end as if undisturbed.

With the toy search, so that many deaths fit into seconds; `test_kill_and_resume.py` does it with the real one.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.service import toy
from tests.service.conftest import FINAL, Api
from tests.service.processes import ServerProcess

Json = dict[str, Any]
SLOW = "0.02"


def server(data: Path, seconds: str = SLOW, env: dict[str, str] | None = None) -> ServerProcess:
    return ServerProcess(data, ("tests.service.toy_server", seconds), env)


def numbers(api: Api, run: str) -> list[Json]:
    return [{key: value for key, value in item.items() if key != "elapsed_seconds"} for item in api.history(run)]


@pytest.fixture
def undisturbed(tmp_path: Path) -> Iterator[tuple[list[Json], Json]]:
    with server(tmp_path / "undisturbed", "0") as one:
        run = one.api.submit(one.api.upload()["id"], max_generations=30, seed=9)["id"]
        assert one.api.finish(run)["state"] == "SUCCEEDED"
        yield numbers(one.api, run), one.api.get(f"/v1/runs/{run}/result")


def test_many_deaths_change_nothing(tmp_path: Path, undisturbed: tuple[list[Json], Json]) -> None:
    data = tmp_path / "data"
    moments = np.random.default_rng(5)
    # A busy machine may let several starts go by without a step forward; giving up is tested further down.
    patient = {"WINGFIT_MAX_STARTS": "1000"}
    with server(data, env=patient) as first:
        dataset = first.api.upload()["id"]
        run = first.api.submit(dataset, max_generations=30, seed=9)["id"]
        first.kill()
    deaths, known = 1, 0
    for _ in range(20):
        with server(data, env=patient) as again:
            assert again.client.get(f"/v1/datasets/{dataset}/archive").content == toy.archive()
            state = again.api.run(run)
            assert state["generations"] >= known, "an acknowledged generation was lost"
            time.sleep(moments.uniform(0.05, 1.0))
            state = again.api.run(run)
            known = state["generations"]
            again.kill()
            deaths += 1
            if state["state"] in FINAL:
                break
    with server(data, env=patient) as last:
        assert last.api.finish(run)["state"] == "SUCCEEDED"
        assert deaths >= 3
        assert (numbers(last.api, run), last.api.get(f"/v1/runs/{run}/result")) == undisturbed


def test_sigterm_stops_within_seconds_and_leaves_runs_to_be_resumed(
    tmp_path: Path, undisturbed: tuple[list[Json], Json]
) -> None:
    data = tmp_path / "data"
    with server(data, "0.05") as first:
        run = first.api.submit(first.api.upload()["id"], max_generations=30, seed=9)["id"]
        first.api.until(run, lambda r: r["generations"] >= 3)
        lines: list[str] = []
        watching = threading.Thread(target=_watch, args=(first, run, lines))
        watching.start()
        time.sleep(0.2)
        began = time.monotonic()
        first.process.send_signal(signal.SIGTERM)
        assert first.process.wait(60) == 0
        assert time.monotonic() - began < 30
        watching.join(60)
        assert "event: generation" in lines
        assert "Traceback" not in first.log
        assert "given up" not in first.log
    with server(data) as second:
        assert second.api.finish(run)["state"] == "SUCCEEDED"
        assert (numbers(second.api, run), second.api.get(f"/v1/runs/{run}/result")) == undisturbed


def test_sigterm_does_not_wait_for_a_long_generation(tmp_path: Path) -> None:
    with server(tmp_path / "data", "60") as first:
        run = first.api.submit(first.api.upload()["id"])["id"]
        first.api.until(run, lambda r: r["state"] == "RUNNING")
        began = time.monotonic()
        first.process.send_signal(signal.SIGTERM)
        assert first.process.wait(60) == 0
        assert time.monotonic() - began < 30
    with server(tmp_path / "data", "0") as second:
        assert second.api.finish(run)["state"] == "SUCCEEDED"


def test_wishes_and_states_outlive_the_server(tmp_path: Path) -> None:
    with server(tmp_path / "data", "5") as first:
        dataset = first.api.upload()["id"]
        to_cancel, to_pause, queued, paused = (first.api.submit(dataset)["id"] for _ in range(4))
        for run in (to_cancel, to_pause):
            first.api.until(run, lambda r: r["state"] == "RUNNING")
        first.api.control(paused, "pause")
        assert first.api.control(to_cancel, "cancel")["pending_action"] == "CANCEL"
        assert first.api.control(to_pause, "pause")["pending_action"] == "PAUSE"
        first.kill()
    with server(tmp_path / "data", "0") as second:
        assert second.api.finish(queued)["state"] == "SUCCEEDED"
        states = [second.api.run(run)["state"] for run in (to_cancel, to_pause, paused)]
        assert states == ["CANCELLED", "PAUSED", "PAUSED"]
        second.api.control(to_pause, "resume")
        assert second.api.finish(to_pause)["state"] == "SUCCEEDED"


def test_a_key_is_remembered_over_a_restart(tmp_path: Path) -> None:
    headers = {"Idempotency-Key": "k"}
    with server(tmp_path / "data", "0") as first:
        body = {"dataset_id": first.api.upload()["id"], "max_generations": 1}
        before = first.client.post("/v1/runs", json=body, headers=headers).json()
        first.kill()
    with server(tmp_path / "data", "0") as second:
        after = second.client.post("/v1/runs", json=body, headers=headers).json()
        assert after == before
        assert len(second.api.get("/v1/runs")["items"]) == 1


def test_a_second_server_on_the_same_folder_is_refused(tmp_path: Path) -> None:
    with server(tmp_path / "data") as first:
        second = server(tmp_path / "data")
        with pytest.raises(AssertionError, match="another wingfit server"):
            second.__enter__()
        assert second.process.wait(60) == 1
        assert f"process {first.process.pid}" in second.log
        assert "Traceback" not in second.log
        assert first.api.get("/v1/health")["status"] == "ok"


def test_answers_are_not_held_back(tmp_path: Path) -> None:
    """Nagle's algorithm with delayed acknowledgements makes every answer take 40 ms."""
    with server(tmp_path / "data") as one:
        took = []
        for _ in range(40):
            began = time.perf_counter()
            one.api.get("/v1/runs")
            took.append(time.perf_counter() - began)
    assert min(took) < 0.02


def test_a_port_in_use_is_refused(tmp_path: Path) -> None:
    with server(tmp_path / "one") as first:
        second = server(tmp_path / "two")
        second._env["WINGFIT_PORT"] = str(first.port)
        second.client.base_url = "http://127.0.0.1:1"
        with pytest.raises(AssertionError, match="set WINGFIT_PORT"):
            second.__enter__()
        assert second.process.wait(60) == 1


def _watch(one: ServerProcess, run: str, lines: list[str]) -> None:
    with one.client.stream("GET", f"/v1/runs/{run}/events") as answer:
        lines.extend(answer.iter_lines())


def test_a_run_that_takes_the_server_down_is_given_up_and_its_neighbour_is_not(tmp_path: Path) -> None:
    data, deaths = tmp_path / "data", 0
    with server(data, "0.3") as first:
        dataset = first.api.upload()["id"]
        guilty = first.api.submit(dataset, max_generations=30, seed=toy.DEADLY)["id"]
        neighbour = first.api.diagnose(dataset)["id"]
        assert first.process.wait(30) == -signal.SIGKILL
    while deaths < 5:
        with server(data, "0.3") as again:
            deaths += 1
            try:
                run = again.api.until(guilty, lambda r: r["state"] == "FAILED", 60.0)
            except (httpx.TransportError, AssertionError):
                assert again.process.wait(30) == -signal.SIGKILL
                continue
            assert again.api.diagnosed(neighbour)["state"] == "SUCCEEDED"
            break
    assert deaths == 3
    assert "the server ended 3 times in a row while this was running" in run["error"]
    assert "(after step 2)" in run["error"]
    assert run["generations"] == 2


def test_stops_in_good_order_say_nothing_against_a_run(tmp_path: Path) -> None:
    data = tmp_path / "data"
    with server(data, "60") as first:
        run = first.api.submit(first.api.upload()["id"])["id"]
        first.api.until(run, lambda r: r["state"] == "RUNNING")
    for _ in range(3):
        with server(data, "60") as again:
            again.api.until(run, lambda r: r["state"] == "RUNNING")
    with server(data, "0") as last:
        assert last.api.finish(run)["state"] == "SUCCEEDED"
