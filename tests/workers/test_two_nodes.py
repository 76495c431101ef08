"""The topology of docker-compose.yml with processes on loopback: a Ray head, a second node, the API joined to them."""

from __future__ import annotations

import json
import secrets
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest
from ray.util import get_node_ip_address

from tests.oracles.processes import REPOSITORY, Node, environment, free_port
from tests.workers import pendulum
from tests.workers.driver import ANSWER, digest
from wingfit.workers import make_evaluator

START_SECONDS = 90.0
WORK_SECONDS = 120.0
NOTICED_SECONDS = 30.0


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
        raise AssertionError(f"the driver ended with {self._process.wait(60)}")

    def end(self) -> None:
        self._process.kill()
        self._process.communicate(timeout=60.0)


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


def node_alive(cluster: Cluster, *options: str, token: Path | None = None, head: str = "") -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "wingfit.workers.node_alive", head or cluster.address, *options], cwd=REPOSITORY,
        env=environment(token or cluster.token), capture_output=True, text=True, check=False, timeout=60.0,
    )  # fmt: skip
    return done.returncode, done.stderr


def test_a_node_knows_whether_it_is_alive(cluster: Cluster, tmp_path: Path) -> None:
    # Ray gives the head, which was started on 127.0.0.1, the address of this machine.
    address = get_node_ip_address()
    assert node_alive(cluster, head=f"{address}:{cluster.address.split(':')[1]}") == (0, "")
    assert node_alive(cluster, "--node=127.0.0.2") == (0, "")
    code, why = node_alive(cluster, "--node=127.0.0.3")
    living = ", ".join(sorted(["127.0.0.2", address]))
    assert (code, f"has the address 127.0.0.3; living: {living}" in why) == (1, True), why
    nobody = f"127.0.0.1:{free_port()}"
    code, why = node_alive(cluster, head=nobody)
    assert (code, f"no Ray head answers at {nobody}" in why) == (1, True), why
    wrong_token = tmp_path / "wrong"
    wrong_token.write_text(secrets.token_hex(32))
    code, why = node_alive(cluster, token=wrong_token)
    assert (code, "does not list its nodes" in why) == (1, True), why


def listening_everywhere(pids: Iterable[int]) -> set[str]:
    """Names of those of the processes that listen on every interface."""
    wild = set()
    for table, address in (("tcp", "0" * 8), ("tcp6", "0" * 32)):
        for line in Path("/proc/net", table).read_text().splitlines()[1:]:
            fields = line.split()
            if fields[1].startswith(f"{address}:") and fields[3] == "0A":  # LISTEN
                wild.add(f"socket:[{fields[9]}]")
    found = set()
    for pid in pids:
        with suppress(OSError):
            if wild & {str(file.readlink()) for file in Path(f"/proc/{pid}/fd").iterdir()}:
                found.add(Path(f"/proc/{pid}/comm").read_text().strip())
    return found


def test_ray_listens_on_every_interface_whatever_its_address(cluster: Cluster) -> None:
    """Why the API's container is not on the published network (docs/decisions/0011). If this fails, it could be."""
    assert {"gcs_server", "raylet"} <= listening_everywhere(cluster.head.pids())
    assert "raylet" in listening_everywhere(cluster.second.pids())


def workers(driver: Driver) -> int:
    """How many the evaluator says there are."""
    driver.ask(Path(), 0.0, 0)
    return int(driver.answer())


def test_two_nodes_give_the_same_bits_even_if_one_dies(cluster: Cluster, tmp_path: Path) -> None:
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

        assert workers(driver) == 2
        driver.ask(second, 0.3, 96)
        assert wait_for(lambda: cluster.second.raylet() in nodes_seen(second), WORK_SECONDS)
        cluster.second.kill()
        assert driver.answer() == wanted
        assert wait_for(lambda: workers(driver) == 1, NOTICED_SECONDS), "a node that is gone is still counted"
        assert wait_for(lambda: node_alive(cluster, "--node=127.0.0.2")[0] == 1, WORK_SECONDS)

        assert intruder.answer().startswith("refused: cannot join the Ray cluster")
