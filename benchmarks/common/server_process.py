"""Runs the server as a separate process with a data folder, for benchmarks that restart and kill it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import httpx

from benchmarks.common.files import REPOSITORY
from benchmarks.common.ray_node import environment, free_port

START_SECONDS = 120.0
DIE_SECONDS = 30.0
WORKERS = 2


class Server:
    """A server process that can be started, stopped and killed repeatedly, always on the same port and data folder.

    The data are in ``folder``/data, the output is in ``folder``/server.log. ``evaluator``: kind of the evaluator, which
    simulates individuals ("in_process", "processes" or "ray"); ``token``, ``ray_address``: access token file and
    address of the Ray cluster; ``settings``: further environment variables.
    """

    def __init__(
        self,
        folder: Path,
        evaluator: str,
        token: Path | None = None,
        ray_address: str = "",
        settings: Mapping[str, str] | None = None,
    ) -> None:
        self.folder, self.port = folder, free_port()
        base = environment(token) if token else dict(os.environ)
        self._environment = base | {
            "WINGFIT_DATA": str(folder / "data"),
            "WINGFIT_PORT": str(self.port),
            "WINGFIT_EVALUATOR": evaluator,
            "WINGFIT_WORKERS": str(WORKERS),
            **(settings or {}),
        }
        if ray_address:
            self._environment["WINGFIT_RAY_ADDRESS"] = ray_address
        self._process: subprocess.Popen[bytes] | None = None
        self.fail_point = ""

    def start(self, fail_point: str = "") -> None:
        """Start the server and wait until it answers.

        ``fail_point``: point in the server's code at which the server kills itself, as "NAME:COUNT" (at the COUNT-th
        pass); this may happen before the server answers, in which case the function returns as well.
        """
        self.fail_point = fail_point
        with (self.folder / "server.log").open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "wingfit.service.server"],
                env=self._environment | ({"WINGFIT_FAIL_POINT": fail_point} if fail_point else {}),
                cwd=REPOSITORY,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        deadline = time.monotonic() + START_SECONDS
        while not self.answers():
            if self._process.poll() is not None:
                if fail_point:
                    return
                raise RuntimeError(f"the server ended with exit code {self._process.returncode}: {self.tail()}")
            if time.monotonic() > deadline:
                raise RuntimeError(f"the server does not answer within {START_SECONDS:g} s: {self.tail()}")
            time.sleep(0.02)

    def answers(self) -> bool:
        """Return whether the server answers a health check now."""
        with suppress(httpx.TransportError):
            return httpx.get(f"http://127.0.0.1:{self.port}/v1/health", timeout=5.0).status_code == 200
        return False

    def peak_mb(self) -> float:
        """Return the server's peak resident memory in MiB, without its workers."""
        lines = (Path("/proc") / str(self.pid) / "status").read_text().splitlines()
        return float(next(line.split()[1] for line in lines if line.startswith("VmHWM:"))) / 1024

    def tail(self) -> str:
        """Return the last 2,000 characters of the server's log."""
        return (self.folder / "server.log").read_text(errors="replace")[-2000:]

    def died(self, seconds: float) -> bool:
        """Wait at most ``seconds`` for the server to end; return whether it ended."""
        assert self._process is not None  # noqa: S101  # started
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)
            return True
        return False

    def kill(self) -> None:
        """Send SIGKILL to the server process only, not to its workers, and wait until it has ended."""
        assert self._process is not None  # noqa: S101  # started
        with suppress(ProcessLookupError):
            os.kill(self._process.pid, signal.SIGKILL)
        self._process.wait(DIE_SECONDS)

    def kill_all(self) -> None:
        """Send SIGKILL to the server and all its descendants, and wait until the server has ended."""
        victims = [self.pid, *descendants(self.pid)]
        for pid in victims:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        assert self._process is not None  # noqa: S101  # started
        self._process.wait(DIE_SECONDS)

    @property
    def pid(self) -> int:
        """Process id of the server."""
        assert self._process is not None  # noqa: S101  # started
        return self._process.pid

    def workers(self) -> list[int]:
        """Return the process ids of the server's workers, which simulate individuals."""
        return [pid for pid, command in _commands(descendants(self.pid)) if _evaluates(command)]

    def stop(self) -> None:
        """Send SIGTERM to the server, and SIGKILL if it does not end within DIE_SECONDS."""
        assert self._process is not None  # noqa: S101  # started
        self._process.terminate()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(DIE_SECONDS)
        if self._process.poll() is None:
            self.kill()


def descendants(pid: int) -> list[int]:
    """Return the process ids of the living children of the process ``pid``, of their children, and so on."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
            if fields[0] != "Z":
                children.setdefault(int(fields[1]), []).append(int(folder.name))
    found, new = list[int](), [pid]
    while new:
        new = [child for parent in new for child in children.get(parent, [])]
        found += new
    return found


def _commands(pids: list[int]) -> Iterator[tuple[int, str]]:
    """Yield (process id, command line) of those of the processes ``pids`` that exist."""
    for pid in pids:
        with suppress(OSError):
            yield pid, (Path("/proc") / str(pid) / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")


def _evaluates(command: str) -> bool:
    """Return whether ``command`` is the command line of a worker: a Python multiprocessing child or a Ray actor."""
    return "spawn_main" in command or command.startswith("ray::")
