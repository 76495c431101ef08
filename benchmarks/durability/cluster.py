"""A Ray cluster as in the deployment with Docker Compose, and ways to kill its nodes."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.common.ray_node import Node, free_port

START_SECONDS = 120.0


class Cluster:
    """A Ray cluster of two nodes: a head and one that computes; ``folder``: for the access token and logs."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.token, self._lives = folder, folder / "token", 0
        self.token.touch(mode=0o600)
        self.token.write_text(secrets.token_hex(32))
        self.port = free_port()
        self.start()

    @property
    def address(self) -> str:
        """Address of the head, as HOST:PORT."""
        return f"127.0.0.1:{self.port}"

    def start(self) -> None:
        """Start the head and the node that computes, and wait until both run."""
        self._lives += 1
        log = self.folder / f"head-{self._lives}.log"
        self.head = Node(
            self.token, log, "--head", "--node-ip-address=127.0.0.1", f"--port={self.port}", "--include-dashboard=false"
        )
        _until(lambda: "Ray runtime started" in log.read_text(errors="replace"), log)
        self.start_node()

    def start_node(self) -> None:
        """Start the node that computes, and wait until it runs."""
        self._lives += 1
        log = self.folder / f"node-{self._lives}.log"
        self.node = Node(self.token, log, f"--address={self.address}")
        _until(lambda: "Ray runtime started" in log.read_text(errors="replace"), log)

    def kill_node(self) -> None:
        """Kill the node that computes."""
        self.node.remove()

    def kill(self) -> None:
        """Kill both nodes."""
        for node in (self.node, self.head):
            node.remove()


def _until(what: Callable[[], bool], log: Path) -> None:
    deadline = time.monotonic() + START_SECONDS
    while not what():
        if time.monotonic() > deadline:
            raise RuntimeError(
                f"Ray does not start within {START_SECONDS:g} s: {log.read_text(errors='replace')[-2000:]}"
            )
        time.sleep(0.1)
