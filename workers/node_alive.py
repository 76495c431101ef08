"""Checks that the Ray node of this machine is alive: ``python -m wingfit.workers.node_alive ray-head:6379``.

The exit status is 0 if the node is alive, else 1 with the reason. The head (main process) of the cluster is queried,
because the processes of a node may live although their connection to the head is lost, or the head has removed the
node. A call takes half a second of processor time to import Ray.
"""

from __future__ import annotations

import argparse
import os
import socket
from typing import Any

TIMEOUT_SECONDS = 5


def main(words: list[str] | None = None) -> None:
    """Check the node that the command-line arguments ``words`` name, by default that of this machine."""
    parser = argparse.ArgumentParser(prog="python -m wingfit.workers.node_alive", description=__doc__)
    parser.add_argument("head", help="address of the cluster's head, as host:port")
    reaching = "IP address of the node (default: the one from which this machine reaches the head)"
    parser.add_argument("--node", help=reaching)
    options = parser.parse_args(words)
    host, _, port = options.head.rpartition(":")
    if not host or not port.isdigit():
        parser.error(f"the head is {options.head!r}; write host:port, for example ray-head:6379")
    check(host, int(port), options.node)


def check(host: str, port: int, node: str | None = None) -> None:
    """Raise SystemExit with the reason unless the cluster's head at ``host``:``port`` lists ``node`` as alive.

    ``node``: IP address of the node, by default that of this machine.
    """
    try:
        with socket.create_connection((host, port), TIMEOUT_SECONDS) as connection:
            # IP addresses of the head and of this machine, as the two see each other.
            head, own = connection.getpeername()[0], connection.getsockname()[0]
    except OSError as error:
        raise SystemExit(f"no Ray head answers at {host}:{port}: {error}") from error
    alive = _living_nodes(f"{head}:{port}")
    if (node or own) not in alive:
        living = ", ".join(sorted(alive)) or "none"
        raise SystemExit(f"no living node of the cluster has the address {node or own}; living: {living}")


def _living_nodes(address: str) -> set[str]:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # Ray reads it at import
    from ray._raylet import GcsClient  # type: ignore[attr-defined]  # compiled
    from ray.core.generated.gcs_pb2 import GcsNodeInfo

    try:
        found: dict[Any, Any] = GcsClient(address=address).get_all_node_info(timeout=TIMEOUT_SECONDS)
    except Exception as error:  # Ray's own errors share no base class
        raise SystemExit(f"the Ray head at {address} does not list its nodes: {error}") from error
    return {node.node_manager_address for node in found.values() if node.state == GcsNodeInfo.ALIVE}


if __name__ == "__main__":
    main()
