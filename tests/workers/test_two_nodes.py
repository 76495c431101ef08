"""The topology of docker-compose.yml with processes on loopback: a Ray head, a second node, the API joined to them."""

from __future__ import annotations

import json
import secrets
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest

from benchmarks.ray_nodes import REPOSITORY, Node, environment, free_port
from tests.workers import pendulum
from tests.workers.driver import ANSWER, digest
from workers import make_evaluator

START_SECONDS = 90.0
WORK_SECONDS = 120.0


@dataclass
class Cluster:
    address: str
    token: Path
    head: Node
    second: Node


class Driver:
    """The other end of ``tests.workers.driver``."""

    def __init__(self, address: str, token: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.workers.driver", address], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, env=environment(token), cwd=REPOSITORY,
        )  # fmt: skip

    def ask(self, folder: Path, seconds: float, individuals: int) -> None:
        assert self._process.stdin
        self._process.stdin.write(json.dumps([str(folder), seconds, individuals]) + "\n")
        self._process.stdin.flush()

    def answer(self) -> str:
        assert self._process.stdout
        for line in self._process.stdout:
            if line.startswith(ANSWER):
                answer: str = json.loads(line.removeprefix(ANSWER))
                return answer
        raise AssertionError(f"the driver ended with {self._process.wait(10)}")

    def end(self) -> None:
        self._process.kill()
        self._process.communicate(timeout=10.0)


def wait_for(what: Callable[[], object], seconds: float, while_running: tuple[Node, ...] = ()) -> bool:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if what():
            return True
        if not all(node.running for node in while_running):
            return False
        time.sleep(0.1)
    return False


def start_head(token: Path, folder: Path) -> tuple[Node, str]:
    """A head node; a port that was free may be taken a moment later, so this is tried again."""
    for attempt in range(3):
        port = free_port()
        log = folder / f"head{attempt}.log"
        head = Node(token, log, "--head", "--node-ip-address=127.0.0.1", f"--port={port}", "--include-dashboard=false")
        if wait_for(lambda log=log: "Ray runtime started" in log.read_text(), START_SECONDS, (head,)):  # type: ignore[misc]
            return head, f"127.0.0.1:{port}"
        head.remove()
    raise AssertionError(log.read_text())


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    folder = tmp_path_factory.mktemp("cluster")
    token = folder / "token"
    token.touch(mode=0o600)
    token.write_text(secrets.token_hex(32))
    with ExitStack() as cleanup:
        head, address = start_head(token, folder)
        cleanup.callback(head.remove)
        second = Node(token, folder / "second.log", f"--address={address}", "--node-ip-address=127.0.0.2")
        cleanup.callback(second.remove)
        joined = wait_for(lambda: "Ray runtime started" in second.log.read_text(), START_SECONDS, (second,))
        assert joined, second.log.read_text()
        yield Cluster(address, token, head, second)


def nodes_seen(folder: Path) -> set[int]:
    """Process ids of the raylets under which units ran so far."""
    notes = [note.read_text().split() for note in folder.iterdir()]
    return {int(note[2]) for note in notes if len(note) == 3}


def test_two_nodes_give_the_same_bits_and_one_may_die(cluster: Cluster, tmp_path: Path) -> None:
    wanted = digest(make_evaluator("in_process").evaluate(pendulum.problem(), pendulum.population(96), residuals=True))
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    raylets = {cluster.head.raylet(), cluster.second.raylet()}
    assert None not in raylets
    wrong_token = tmp_path / "wrong"
    wrong_token.write_text(secrets.token_hex(32))
    with ExitStack() as cleanup:
        intruder = Driver(cluster.address, wrong_token)
        cleanup.callback(intruder.end)
        driver = Driver(cluster.address, cluster.token)
        cleanup.callback(driver.end)
        assert driver.answer() == "joined"

        driver.ask(first, 0.1, 96)
        assert driver.answer() == wanted
        assert nodes_seen(first) == raylets

        # One generation after the other is shared by both; Ray's default strategy comes to leave them to one.
        shared = []
        for number in range(10):
            generation = tmp_path / f"generation-{number}"
            generation.mkdir()
            driver.ask(generation, 0.04, 12)
            driver.answer()
            shared.append(nodes_seen(generation) == raylets)
        assert sum(shared) >= 8, shared

        driver.ask(second, 0.3, 96)
        assert wait_for(lambda: cluster.second.raylet() in nodes_seen(second), WORK_SECONDS)
        cluster.second.kill()
        assert driver.answer() == wanted

        assert intruder.answer().startswith("refused: cannot join the Ray cluster")
