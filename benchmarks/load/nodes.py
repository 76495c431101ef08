"""Measures how a calibration scales from one to two Ray nodes of one processor each, on this machine."""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path
from typing import Any

from benchmarks.common.server_process import Server
from benchmarks.durability.cluster import Cluster
from benchmarks.load.calibrations import ROBIRD, computed
from wingfit.client.client import Client

Json = dict[str, Any]
SETTLE_SECONDS = 120.0


def scaling(folder: Path, work: Json, short: Json, rounds: int) -> Json:
    """Measure the pace (evaluations per second) of a calibration with one and with two Ray nodes.

    ``work``: request of the calibration, which is run with each number of nodes in each of ``rounds`` rounds;
    ``short``: request of a calibration for warming up. The returned efficiency is the pace with two nodes divided by
    twice the pace with one.
    """
    folder.mkdir()
    cluster = Cluster(folder)
    server = Server(folder, "ray", cluster.token, cluster.address)
    paces: dict[int, list[float]] = {1: [], 2: []}
    now = 2
    try:
        server.start()
        with Client(f"http://127.0.0.1:{server.port}") as client:
            dataset = client.upload_dataset(ROBIRD)["id"]
            for number in range(rounds):
                for nodes in (2, 1) if number % 2 == 0 else (1, 2):
                    now = _set_nodes(cluster, nodes, now)
                    _settle(client, short | {"dataset_id": dataset}, nodes)
                    seconds, evaluations = computed(client, client.submit_run(**work | {"dataset_id": dataset})["id"])
                    paces[nodes].append(evaluations / seconds)
    finally:
        server.stop()
        cluster.kill()
    one, two = (statistics.median(paces[nodes]) for nodes in (1, 2))
    return {
        "evaluations_per_second": {nodes: [round(pace, 2) for pace in found] for nodes, found in paces.items()},
        "efficiency": round(two / (2 * one), 3),
        "processors": len(os.sched_getaffinity(0)),
    }


def _set_nodes(cluster: Cluster, nodes: int, now: int) -> int:
    """Start or kill a node if their number is ``now`` and should be ``nodes``; return ``nodes``."""
    if nodes < now:
        cluster.kill_node()
    elif nodes > now:
        cluster.start_node()
    return nodes


def _settle(client: Client, short: Json, nodes: int) -> None:
    """Compute short runs until the server has one worker on each of ``nodes`` nodes and their code is compiled.

    RuntimeError after SETTLE_SECONDS.
    """
    deadline = time.monotonic() + SETTLE_SECONDS
    while True:
        computed(client, client.submit_run(**short)["id"])
        if client.health()["workers"] == nodes:
            return
        if time.monotonic() > deadline:
            raise RuntimeError(
                f"the server has {client.health()['workers']} workers instead of {nodes} after {SETTLE_SECONDS:g} s"
            )
