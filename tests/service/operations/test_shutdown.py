"""A signal ends the server in bounded time whatever hangs, and the log names what was given up."""

from __future__ import annotations

import os
import re
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from tests.service.processes import ServerProcess
from tests.service.toy import STUCK_SEED
from wingfit.service.operations import shutdown
from wingfit.service.operations.shutdown import StopLimits

ANYIO_THREADS = 40
NEVER = 600.0


def stuck(data: Path, part: str, give_up: float = NEVER, kill: float = NEVER) -> ServerProcess:
    return ServerProcess(data, ("tests.service.operations.stuck_server", part, str(give_up), str(kill)))


def until_it_hangs(server: ServerProcess, times: int = 1) -> None:
    deadline = time.monotonic() + 60
    while server.log.count("HANGS") < times:
        assert time.monotonic() < deadline, server.log
        time.sleep(0.02)
    time.sleep(0.1)


def stopped(server: ServerProcess, seconds: float, number: signal.Signals = signal.SIGTERM) -> int:
    """The exit code, within ``seconds`` of the signal."""
    server.process.send_signal(number)
    return server.process.wait(seconds)


def with_a_run(server: ServerProcess) -> str:
    run = str(server.api.submit(server.api.upload()["id"])["id"])
    until_it_hangs(server)
    return run


def test_a_hanging_job_is_given_up_and_continues_later(tmp_path: Path) -> None:
    with stuck(tmp_path / "data", "job") as server:
        run = with_a_run(server)
        assert stopped(server, 5) == 0
        assert f"run {run} stays as stored (after step 2) and continues at the next start" in server.log
        assert re.search(rf"thread '{run}' at \S+stuck_server.py:\d+ \(hang_here\)", server.log)
    with toy(tmp_path) as again:
        assert again.api.finish(run)["state"] == "SUCCEEDED"


def test_hanging_parts_do_not_delay_the_stop(tmp_path: Path) -> None:
    """Every thread of the pool, a write to the database, the end of the evaluator, all at once."""
    with (
        stuck(tmp_path / "data", "requests,database,evaluator") as server,
        ThreadPoolExecutor(ANYIO_THREADS) as crowd,
    ):
        run = with_a_run(server)
        body = {"dataset_id": server.api.run(run)["dataset_id"], "seed": STUCK_SEED}

        def submit(_: int) -> None:
            answer = httpx.post(f"{server.client.base_url}/v1/runs", json=body, timeout=90)
            assert (answer.status_code, answer.json()["type"]) == (503, "urn:wingfit:problem:stopping")
            assert int(answer.headers["Retry-After"]) > 0

        asked = [crowd.submit(submit, k) for k in range(ANYIO_THREADS)]
        until_it_hangs(server, 1 + ANYIO_THREADS)
        assert stopped(server, 8) == 0
        for one in asked:
            one.result()
        assert "Traceback" not in server.log
        assert len(re.findall(r"given up: POST /v1/runs, since \d", server.log)) == ANYIO_THREADS
        assert server.log.count("given up: thread 'AnyIO worker thread' at") == ANYIO_THREADS
        assert "a database write has not ended within 0.3 s; it is rolled back" in server.log
        assert "the evaluator has not stopped within 0.3 s" in server.log


def test_a_hanging_event_loop_is_given_up(tmp_path: Path) -> None:
    with stuck(tmp_path / "data", "loop", give_up=1.0) as server:
        with pytest.raises(httpx.ReadTimeout):
            server.client.get("/v1/runs/run_none/history", timeout=0.5)
        until_it_hangs(server)
        assert stopped(server, 5, signal.SIGINT) == 0
        assert re.search(r"given up: GET /v1/runs/run_none/history, since \d\.\d s", server.log)
        assert re.search(r"given up: thread 'MainThread' at \S+stuck_server.py:\d+ \(hang_here\)", server.log)


def test_a_server_that_cannot_run_python_any_more_is_killed(tmp_path: Path) -> None:
    with stuck(tmp_path / "data", "interpreter", kill=1.0) as server:
        with_a_run(server)
        assert stopped(server, 5) == -signal.SIGKILL
        assert f"process {server.process.pid} has not ended 1 s after the signal to stop" in server.log
        assert re.search(r'File "\S+stuck_server.py", line \d+ in hang_in_c', server.log)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_an_ordinary_stop_is_quick_and_the_watchdog_ends_with_the_server(
    tmp_path: Path, number: signal.Signals
) -> None:
    with toy(tmp_path) as server:
        watchdog = watchdog_of(server)
        os.kill(watchdog, signal.SIGTERM)  # as a service manager sends it to all processes of a service
        os.kill(watchdog, signal.SIGINT)
        server.api.finish(server.api.submit(server.api.upload()["id"])["id"])
        assert watchdog_of(server) == watchdog
        began = time.monotonic()
        assert stopped(server, 60, number) == (0 if number == signal.SIGTERM else -number)
        assert time.monotonic() - began < 30
        assert "WARNING" not in server.log
        deadline = time.monotonic() + 60
        while Path(f"/proc/{watchdog}").exists():
            assert time.monotonic() < deadline
            time.sleep(0.01)


def test_a_server_whose_watchdog_has_died_works_and_stops(tmp_path: Path) -> None:
    with toy(tmp_path) as server:
        os.kill(watchdog_of(server), signal.SIGKILL)
        server.api.finish(server.api.submit(server.api.upload()["id"])["id"])
        assert stopped(server, 5) == 0
        assert "WARNING" not in server.log


def test_the_steps_of_the_stop_fit_into_its_limits() -> None:
    limits = StopLimits()
    slack = shutdown.REPORT_SECONDS + shutdown.JOIN_SECONDS
    assert limits.requests + limits.jobs + limits.evaluator + limits.database < limits.give_up
    assert limits.give_up + shutdown.REPORT_SECONDS * 2 + slack < limits.kill
    assert limits.kill + shutdown.REPORT_SECONDS < 30


@contextmanager
def toy(folder: Path) -> Iterator[ServerProcess]:
    with ServerProcess(folder / "data", ("tests.service.toy_server", "0")) as server:
        yield server


def watchdog_of(server: ServerProcess) -> int:
    pid = server.process.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    (watchdog,) = [one for one in children if b"watchdog.py" in Path(f"/proc/{one}/cmdline").read_bytes()]
    return int(watchdog)
