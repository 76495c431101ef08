"""``python -m benchmarks.load --json``: reads, watchers and pages beside a calibration that uses all processors.

Over a database of 10,000 runs and 1,000,000 generations. The generator of the load runs on the same machine, and what
it takes of the processors is told apart from what the server takes (docs/load.md).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from benchmarks.common import machine
from benchmarks.common.server_process import Server
from benchmarks.load.beside import Load, beside, per_read_us
from benchmarks.load.calibrations import LONG, ROBIRD, SHORT, computed
from benchmarks.load.filling import Filled, fill
from benchmarks.load.mix import walk
from benchmarks.load.nodes import scaling
from benchmarks.load.pages import pages
from wingfit.client.client import Client

Json = dict[str, Any]
NONE, WATCHED, CALM, BRISK, FULL = "undisturbed", "watched", "calm", "brisk", "full"
LIMITS = {
    "read_p99_ms": 100.0,
    "sse_p99_ms": 250.0,
    "calibration_slowdown_percent": 10.0,
    "list_page_ms": 100.0,
    "history_page_ms": 100.0,
}
REACHED = 0.99  # of the reads per second that are asked for


@dataclass(frozen=True)
class Size:
    """How much of everything."""

    runs: int
    each: int
    longest: int
    rate: float
    watchers: int
    rounds: int
    work: Json

    @property
    def loads(self) -> Sequence[Load]:
        """One watcher tells when the undisturbed run ends."""
        return (
            Load(NONE, 0.0, 1),
            Load(WATCHED, 0.0, self.watchers),
            Load(CALM, self.rate / 10, self.watchers),
            Load(BRISK, self.rate / 2, self.watchers),
            Load(FULL, self.rate, self.watchers),
        )


WHOLE = Size(10_000, 100, 20_000, 1000.0, 100, 5, LONG)
QUICK = Size(200, 20, 3000, 200.0, 20, 1, SHORT)


def main() -> None:
    """Measure everything, and print one JSON object as the last line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.load", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line (always printed)")
    parser.add_argument("--quick", action="store_true", help="a little of everything, whose figures mean nothing")
    parser.add_argument("--rounds", type=int, help=f"turns of each load (default {WHOLE.rounds})")
    parser.add_argument("--no-ray", action="store_true", help="without Ray nodes")
    asked = parser.parse_args()
    began, size = time.monotonic(), QUICK if asked.quick else WHOLE
    rounds = asked.rounds or size.rounds
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        told = served(Path(scratch), size, rounds)
        if not asked.no_ray:
            told["nodes"] = scaling(Path(scratch) / "nodes", size.work, SHORT, max(1, rounds // 2))
            told["node_efficiency"] = told["nodes"]["efficiency"]
    told["missed"] = missed(told)
    told |= {
        "seconds": round(time.monotonic() - began, 1),
        "processor": machine.cpu(),
        "commit": machine.commit(),
        "quick": asked.quick,
    }
    print(json.dumps(told))
    sys.exit(1 if told["missed"] else 0)


def served(scratch: Path, size: Size, rounds: int) -> Json:
    """Loads and pages over a filled database."""
    server = Server(scratch, "processes")
    try:
        filled, dataset = _filled(server, size)
        with httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60.0) as http:
            stored = walk(http)
        with Client(f"http://127.0.0.1:{server.port}") as client:
            computed(client, client.submit_run(dataset, **SHORT)["id"])
            long = size.work | {"dataset_id": dataset, "max_generations": 10 * size.work["max_generations"]}
            beneath = client.submit_run(**long)["id"]
            times = pages(server.port, stored, filled, dataset)
            client.cancel(beneath)
            client.wait(beneath)
            found = beside(server, client, size.work | {"dataset_id": dataset}, stored, size.loads, rounds)
        peak_mb = round(server.peak_mb(), 1)
    finally:
        server.stop()
    full = found[FULL]
    return {
        "reads_per_second": full["reads_per_second"],
        "read_p99_ms": full["reads"]["p99_ms"],
        "sse_watchers": full["watchers"],
        "sse_p99_ms": full["events"]["p99_ms"],
        "calibration_slowdown_percent": full["slowdown_percent"],
        "reads_per_second_within_limit": within_limit(found),
        "list_page_ms": _worst(times, "list"),
        "history_page_ms": _worst(times, "history, first", "history, in", "history, last"),
        "runs_stored": filled.runs,
        "generations_stored": filled.generations,
        "server_us_per_read": per_read_us(full, found[WATCHED]),
        "server_percent_of_a_processor": full["server_percent_of_a_processor"],
        "crowd_percent_of_a_processor": full["crowd_percent_of_a_processor"],
        "server_peak_mb": peak_mb,
        "beside": found,
        "pages": times,
    }


def within_limit(found: Json) -> float:
    """The largest rate at which the calibration is not slower than it may be."""
    limit = LIMITS["calibration_slowdown_percent"]
    return max((load["asked_per_second"] for load in found.values() if load["slowdown_percent"] <= limit), default=0.0)


def missed(told: Json) -> list[str]:
    """What is not as it must be."""
    full = told["beside"][FULL]
    faults = [
        f"{name} is {told[name]}, must be at most {limit:g}"
        for name, limit in LIMITS.items()
        if told[name] is None or told[name] > limit
    ]
    if told["reads_per_second"] < REACHED * full["asked_per_second"]:
        faults.append(f"of {full['asked_per_second']:g} reads a second {told['reads_per_second']:g} were answered")
    for load, found in told["beside"].items():
        faults += [f"{load}: {found[what]} {what}" for what in ("refused", "unanswered", "cut") if found[what]]
    return faults


def _filled(server: Server, size: Size) -> tuple[Filled, str]:
    """A run is computed and copied; then the server starts again. The dataset of the run as well."""
    server.start()
    with Client(f"http://127.0.0.1:{server.port}") as client:
        dataset = client.upload_dataset(ROBIRD)["id"]
        computed(client, client.submit_run(dataset, **SHORT)["id"])
    server.stop()
    filled = fill(server.folder / "data", size.runs, size.each, size.longest)
    server.start()
    return filled, dataset


def _worst(times: Json, *begin: str) -> float:
    return max(float(found["p99_ms"]) for name, found in times.items() if name.startswith(begin))


if __name__ == "__main__":
    main()
