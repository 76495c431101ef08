"""A server as a process of its own, to be killed."""

from __future__ import annotations

import multiprocessing
import os
import runpy
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import httpx

from tests.service.conftest import Api

ROOT = Path(__file__).parents[2]

# Importing what a server needs takes seconds of a processor. This process does it once, and servers of tests are its
# forks; servers of users are started as users start them.
_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["pytest", "wingfit.service.server", "tests.service.toy", "tests.service.toy_diagnosis"])


class ForkedProcess:
    """What tests use of :class:`subprocess.Popen`, of ``python -m MODULE ARGUMENTS`` in a fork."""

    def __init__(self, module: Sequence[str], env: Mapping[str, str], log: Path) -> None:
        self._process = _FORKS.Process(target=_run, args=(list(module), dict(env), str(log)))
        self._process.start()
        assert self._process.pid is not None
        self.pid = self._process.pid

    def poll(self) -> int | None:
        return self._process.exitcode

    def wait(self, seconds: float | None = None) -> int:
        self._process.join(seconds)
        if (code := self._process.exitcode) is None:
            raise subprocess.TimeoutExpired("the server", seconds or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def _run(module: list[str], env: dict[str, str], log: str) -> None:
    with Path(log).open("wb", buffering=0) as out:
        os.dup2(out.fileno(), 1)
        os.dup2(out.fileno(), 2)
    os.environ.clear()
    os.environ.update(env)
    os.chdir(ROOT)
    sys.argv = module
    runpy.run_module(module[0], run_name="__main__", alter_sys=True)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class ServerProcess:
    """``python -m MODULE ARGUMENTS``, started on entering, stopped on leaving; ``kill`` is kill -9.

    A ``forked`` one has imported already; by default all are but those that users start.
    """

    def __init__(
        self, data: Path, module: Sequence[str], env: Mapping[str, str] | None = None, *, forked: bool | None = None
    ) -> None:
        self.port = free_port()
        self._log = data.parent / f"server-{self.port}.log"
        self._module = module
        self._forked = module[0].startswith("tests.") if forked is None else forked
        self._env = {**os.environ, "WINGFIT_DATA": str(data), "WINGFIT_PORT": str(self.port), **(env or {})}
        self.process: subprocess.Popen[bytes] | ForkedProcess
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}", timeout=60.0)
        self.api = Api(self.client)

    def __enter__(self) -> Self:
        if self._forked:
            self.process = ForkedProcess(self._module, self._env, self._log)
        else:
            with self._log.open("wb") as log:
                command = [sys.executable, "-m", *self._module]
                self.process = subprocess.Popen(command, env=self._env, cwd=ROOT, stdout=log, stderr=subprocess.STDOUT)
        deadline = time.monotonic() + 60
        while not self._answers():
            assert self.process.poll() is None, self.log
            assert time.monotonic() < deadline, self.log
            time.sleep(0.02)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.client.close()
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(60)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    @property
    def log(self) -> str:
        return self._log.read_text(errors="replace")

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(60)

    def _answers(self) -> bool:
        try:
            return self.client.get("/v1/health").status_code == 200
        except httpx.TransportError:
            return False


def heed_interrupts() -> None:
    """For a child that is to be interrupted: one started in the background inherits that SIGINT is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
