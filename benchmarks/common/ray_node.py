"""Starts and kills Ray nodes as processes on this machine.

The processes of a node share a unique text in their environment, the node's mark, by which all of them can be found and
killed.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import uuid
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from benchmarks.common.files import REPOSITORY

MARK = "WINGFIT_TEST_NODE"
# Ray detects a dead node after about three seconds instead of its default of about fifteen.
IMPATIENT = {
    "RAY_health_check_initial_delay_ms": "2000",
    "RAY_health_check_period_ms": "1000",
    "RAY_health_check_timeout_ms": "2000",
    "RAY_health_check_failure_threshold": "3",
}


def environment(token: Path, **more: str) -> dict[str, str]:
    """Return the environment variables of this process, those of a container of the deployment, and ``more``.

    Variables of this process that begin with RAY_ are omitted. ``token``: file with the access token of the Ray
    cluster.
    """
    clean = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    return clean | {
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN_PATH": str(token),
        "RAY_USAGE_STATS_ENABLED": "0",
        "PYTHONPATH": str(REPOSITORY),
        **more,
    }


class Process(NamedTuple):
    """A process of this machine as described in /proc: name of its program, state letter (Z: ended), parent's id.

    ``environment``: its variables as NAME=value; empty if it has ended.
    """

    name: str
    state: str
    parent: int
    environment: list[bytes]


def _processes() -> dict[int, Process]:
    """Return all processes of this machine, by process id."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            name, rest = (folder / "stat").read_text().split("(", 1)[1].rsplit(")", 1)
            state, parent = rest.split()[:2]
            variables = (folder / "environ").read_bytes().split(b"\0") if state != "Z" else []
            found[int(folder.name)] = Process(name, state, int(parent), variables)
    return found


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def marked(mark: str) -> dict[int, str]:
    """Return the names, by process id, of the living processes marked with ``mark``, and of their descendants.

    A marked process has the variable WINGFIT_TEST_NODE=``mark`` in its environment. Some processes would be missed
    without the descendants: Ray renames them, which overwrites their environment.
    """
    wanted = f"{MARK}={mark}".encode()
    everyone = _processes()
    found = {pid for pid, process in everyone.items() if wanted in process.environment}
    while more := {pid for pid, process in everyone.items() if process.parent in found} - found:
        found |= more
    return {pid: everyone[pid].name for pid in found if everyone[pid].state != "Z"}


class Node:
    """One Ray node: the process ``ray start`` and all processes that it starts.

    ``token``: file with the cluster's access token; ``log``: file for the output; ``options``: more options of ``ray
    start``.
    """

    def __init__(self, token: Path, log: Path, *options: str) -> None:
        self.mark = uuid.uuid4().hex
        # It contains sockets, whose paths must be short, so it is not in pytest's folder.
        self.folder = tempfile.TemporaryDirectory(prefix="wf-", dir="/tmp", ignore_cleanup_errors=True)
        command = [
            str(Path(sys.executable).with_name("ray")), "start", "--block", "--num-cpus=1", "--disable-usage-stats",
            "--object-store-memory=80000000", f"--temp-dir={self.folder.name}", *options,
        ]  # fmt: skip
        self.log = log
        with log.open("w") as out:
            self._process = subprocess.Popen(  # noqa: S603  # our own arguments
                command, stdin=subprocess.DEVNULL, stdout=out, stderr=out, start_new_session=True,
                env=environment(token, **{MARK: self.mark}, **IMPATIENT),
            )  # fmt: skip

    @property
    def running(self) -> bool:
        """Whether the process ``ray start`` is alive."""
        return self._process.poll() is None

    def pids(self) -> dict[int, str]:
        """Return the names of the living processes of this node, by process id."""
        return marked(self.mark)

    def raylet(self) -> int | None:
        """Return the process id of the node's scheduler (raylet); None if it is not running."""
        return next((pid for pid, name in self.pids().items() if name == "raylet"), None)

    def kill(self) -> None:
        """Send SIGKILL to every process of the node until none lives; RuntimeError if some still live after 10 s."""
        victims = self.pids()
        deadline = time.monotonic() + 10.0
        while victims and time.monotonic() < deadline:
            for pid in victims:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.05)
            everyone = _processes()
            victims = {p: n for p, n in victims.items() if p in everyone and everyone[p].state != "Z"} | self.pids()
        self._process.wait(10.0)
        if victims:
            raise RuntimeError(f"these processes of a Ray node survive SIGKILL: {victims}")

    def remove(self) -> None:
        """Kill the node and delete its temporary folder."""
        self.kill()
        self.folder.cleanup()
