"""``python -m benchmarks.durability --json``: kills the server, workers, Ray nodes, or all of them, again and again.

Workers are also stopped (SIGSTOP), as by a swapping machine or a debugger; the server must replace each. Meanwhile
clients upload, submit, watch, pause, resume and cancel, and record every answer. At the end everything that the server
acknowledged must be stored, every run must have the result of an undisturbed run, and the database must be intact.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from benchmarks.common import machine
from benchmarks.common.files import archive
from benchmarks.common.jobs import FINAL, succeeded
from benchmarks.common.progress import show_count
from benchmarks.common.server_process import WORKERS, Server
from benchmarks.durability.clients import Client, finding, outcome, settle, settle_diagnosis
from benchmarks.durability.cluster import Cluster
from benchmarks.durability.ledger import Ledger
from benchmarks.durability.workloads import DIAGNOSED, DIAGNOSIS, WORKS
from wingfit.service.storage.database import FILE_NAME

Json = dict[str, Any]
KILLS = {"server": 300, "workers": 60, "hung": 20, "nodes": 20, "stack": 20}
CLIENTS = 2
LONGEST_LIFE = 2.5  # s, scale of the random times between kills
# Several runs at once, so that a diagnosis, which starts again after every restart, does not block the others; many
# starts per job, so that the kills do not count as failures of the job.
ROOMY = {"WINGFIT_MAX_RUNS": "4", "WINGFIT_MAX_STARTS": "1000"}
OF_DIAGNOSES = "diagnosis"
PLACES = ("commit", "committed", "answer")  # fail points of the server
QUIET_SECONDS = 600.0
# Longer than any unit of these workloads may take before its worker counts as hung.
REPLACED_SECONDS = 300.0
EVALUATORS = {"server": "in_process", "workers": "processes", "hung": "processes", "nodes": "ray", "stack": "ray"}


def main() -> None:
    """Parse the command line, kill in the requested ways, and print one JSON object as the last line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.durability", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line (always printed)")
    parser.add_argument(
        "--kills",
        type=int,
        help="number of kills of the server, with the others in proportion; with --only, of that kind",
    )
    parser.add_argument("--only", choices=sorted(KILLS), help="kill in this way only")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    began, most = time.monotonic(), KILLS[options.only or "server"]
    part = 1.0 if options.kills is None else options.kills / most
    kinds = [options.only] if options.only else list(KILLS)
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        expected = undisturbed(Path(scratch) / "undisturbed")
        found = {
            kind: season(kind, max(1, round(part * KILLS[kind])), options.seed, Path(scratch) / kind, expected)
            for kind in kinds
        }
    results, identical = (sum(one[name] for one in found.values()) for name in ("results", "identical"))
    figures = {
        "kills": {kind: one["kills"] for kind, one in found.items()},
        "hung": found["hung"]["kills"] if "hung" in found else 0,
        "hung_recovered": found["hung"]["recovered"] if "hung" in found else 0,
        "lost": sum(len(one["lost"]) for one in found.values()),
        "stuck": sum(one["stuck"] for one in found.values()),
        "integrity": "ok" if all(one["integrity"] == "ok" for one in found.values()) else "damaged",
        "identical_percent": 100.0 * identical / results if results else 0.0,
        "by_kind": found,
        "seconds": round(time.monotonic() - began, 1),
        "processor": machine.cpu(),
        "commit": machine.commit(),
    }
    print(json.dumps(figures))
    whole = not figures["lost"] and not figures["stuck"] and figures["integrity"] == "ok" and identical == results
    sys.exit(0 if whole and figures["hung"] == figures["hung_recovered"] else 1)


def undisturbed(folder: Path) -> dict[str, Json]:
    """Compute every workload on a server that is not disturbed; return the results by name of the workload.

    :func:`season` compares with them. ``folder``: new folder for the server's data.
    """
    folder.mkdir()
    server, ends = Server(folder, "in_process"), {}
    server.start()
    with httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60.0) as http:
        uploaded = {
            example: http.post("/v1/datasets", files={"file": (f"{example}.zip", archive(example))}).json()["id"]
            for example in {work.example for work in WORKS}
        }
        for work in WORKS:
            run = succeeded(http, "runs", work.body | {"dataset_id": uploaded[work.example]})
            ends[work.name] = outcome(run, lambda path: http.get(path).json())
        diagnosis = succeeded(http, "diagnoses", DIAGNOSIS | {"dataset_id": uploaded[DIAGNOSED]})
        ends[OF_DIAGNOSES] = finding(diagnosis, lambda path: http.get(path).json())
    server.stop()
    return ends


def season(kind: str, kills: int, seed: int, folder: Path, expected: dict[str, Json]) -> Json:
    """Kill ``kills`` times in one way while clients use the server, wait until all jobs have ended, then check.

    ``kind``: what is killed, a key of KILLS; ``folder``: new folder for the server's data; ``expected``: results of
    :func:`undisturbed`. Returns, for the report, counts of jobs and of equal results, different results, and losses.
    """
    folder.mkdir()
    cluster = Cluster(folder) if EVALUATORS[kind] == "ray" else None
    token, address = (cluster.token, cluster.address) if cluster else (None, "")
    server = Server(folder, EVALUATORS[kind], token, address, ROOMY)
    server.start()
    ledger, rng = Ledger(), np.random.default_rng([seed, kills])
    clients = [Client(number, seed, server.port, ledger, expected) for number in range(CLIENTS)]
    for client in clients:
        client.start()
    began, recovered = time.monotonic(), 0
    for number in range(kills):
        recovered += DEATHS[kind](server, cluster, rng) is not False
        failed = next((client.error for client in clients if client.error), None)
        if failed:
            raise failed
        show_count(f"killing: {kind}", number + 1, kills, began)
    for client in clients:
        client.leave()
        client.join(60)
    if server.fail_point:
        server.kill()
        server.start()
    stuck = _quiet(server, ledger, expected)
    server.stop()
    if cluster:
        cluster.kill()
    return {
        "kills": kills,
        "recovered": recovered,
        "acknowledged": ledger.acknowledged,
        "runs": len(ledger.runs),
        "diagnoses": len(ledger.diagnoses),
        "results": ledger.results,
        "identical": ledger.identical,
        "different": ledger.different,
        "lost": ledger.lost,
        "stuck": stuck,
        "integrity": _integrity(folder / "data" / FILE_NAME),
    }


# -- kills --------------------------------------------------------------------------------------------------


def _of_server(server: Server, _: Cluster | None, rng: np.random.Generator) -> None:
    """Kill the server, at a random time or at the fail point set at its last start, and restart it."""
    server.died(4 * LONGEST_LIFE if server.fail_point else rng.uniform(0.0, LONGEST_LIFE))
    server.kill()
    armed = f"{PLACES[rng.integers(len(PLACES))]}:{rng.integers(1, 60)}"
    server.start(armed if rng.random() < 0.5 else "")


def _of_worker(server: Server, _: Cluster | None, rng: np.random.Generator) -> None:
    """Kill a random worker of the server, after a random time."""
    with suppress(ProcessLookupError):
        os.kill(_some_worker(server, rng), signal.SIGKILL)


def _stop_of_worker(server: Server, _: Cluster | None, rng: np.random.Generator) -> bool:
    """Stop a random worker (SIGSTOP); return whether the server replaces it within REPLACED_SECONDS."""
    worker = _some_worker(server, rng)
    try:
        os.kill(worker, signal.SIGSTOP)
    except ProcessLookupError:
        return _stop_of_worker(server, None, rng)
    deadline = time.monotonic() + REPLACED_SECONDS
    while time.monotonic() < deadline:
        workers = server.workers()
        if worker not in workers and len(workers) == WORKERS:
            return True
        time.sleep(0.1)
    return False


def _some_worker(server: Server, rng: np.random.Generator) -> int:
    time.sleep(rng.uniform(0.2, LONGEST_LIFE))
    workers = server.workers()
    while not workers:
        time.sleep(0.1)
        workers = server.workers()
    return int(workers[rng.integers(len(workers))])


def _of_node(_: Server, cluster: Cluster | None, rng: np.random.Generator) -> None:
    """Kill the only Ray node that computes, after a random time, and start another."""
    assert cluster is not None  # noqa: S101  # of this kind
    time.sleep(rng.uniform(1.0, 2 * LONGEST_LIFE))
    cluster.kill_node()
    cluster.start_node()


def _of_all(server: Server, cluster: Cluster | None, rng: np.random.Generator) -> None:
    """Kill the server and both Ray nodes together, after a random time, and start them again."""
    assert cluster is not None  # noqa: S101  # of this kind
    time.sleep(rng.uniform(1.0, 4 * LONGEST_LIFE))
    server.kill_all()
    cluster.kill()
    cluster.start()
    server.start()


DEATHS: dict[str, Callable[[Server, Cluster | None, np.random.Generator], bool | None]] = {
    "server": _of_server,
    "workers": _of_worker,
    "hung": _stop_of_worker,
    "nodes": _of_node,
    "stack": _of_all,
}


# -- checks -------------------------------------------------------------------------------------------------


def _quiet(server: Server, ledger: Ledger, expected: dict[str, Json]) -> int:
    """Wait until all jobs have ended, without kills, and check their results; paused runs are resumed.

    Returns the number of jobs that do not end within QUIET_SECONDS.
    """
    with httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60.0) as http:

        def fetch(path: str) -> Json | None:
            answer = http.get(path)
            return dict(answer.json()) if answer.status_code == 200 else None

        deadline, left = time.monotonic() + QUIET_SECONDS, [r for r, k in ledger.runs.items() if k.final is None]
        while left and time.monotonic() < deadline:
            for run in list(left):
                now = fetch(f"/v1/runs/{run}")
                if now is None:
                    ledger.lose(f"run {run} is unknown")
                elif now["state"] == "PAUSED" or now["pending_action"] == "PAUSE":
                    http.post(f"/v1/runs/{run}/resume")
                    continue
                elif now["state"] in FINAL:
                    settle(ledger, run, now, fetch, expected)
                else:
                    continue
                left.remove(run)
            time.sleep(0.2)
        waiting = _diagnoses(ledger, fetch, expected[OF_DIAGNOSES], deadline)
        for run in ledger.runs:
            items = fetch(f"/v1/runs/{run}/history?limit=10000")
            ledger.history(run, items["items"] if items else [])
    return len(left) + waiting


def _diagnoses(ledger: Ledger, fetch: Callable[[str], Json | None], expected: Json, deadline: float) -> int:
    """Wait until all diagnoses have ended and check their findings; return the number of those that do not end.

    ``fetch``: returns the JSON at a path of the API, or None; ``deadline``: latest end of the wait, by
    ``time.monotonic``.
    """
    left = [diagnosis for diagnosis, state in ledger.diagnoses.items() if state is None]
    while left and time.monotonic() < deadline:
        for diagnosis in list(left):
            now = fetch(f"/v1/diagnoses/{diagnosis}")
            if now is None:
                ledger.lose(f"diagnosis {diagnosis} is unknown")
            elif now["state"] in FINAL:
                settle_diagnosis(ledger, diagnosis, now, fetch, expected)
            else:
                continue
            left.remove(diagnosis)
        time.sleep(0.2)
    return len(left)


def _integrity(path: Path) -> str:
    connection = sqlite3.connect(path)
    try:
        (found,) = connection.execute("PRAGMA integrity_check").fetchone()
        broken = connection.execute("PRAGMA foreign_key_check").fetchall()
    finally:
        connection.close()
    return "ok" if found == "ok" and not broken else f"{found}, {len(broken)} broken references"


if __name__ == "__main__":
    main()
