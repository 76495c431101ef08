"""``python -m benchmarks.load --json``: tests the server under load, while a calibration uses all processors.

Measures reads, event streams and pages over a database of 10,000 runs and 1,000,000 generations. The load generator
runs on the same machine; its processor time is reported apart from the server's (docs/load.md).
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
NONE, WATCHED, READ = "undisturbed", "watched", "read"
LIMITS = {
    "read_p99_ms": 100.0,
    "sse_p99_ms": 250.0,
    "calibration_slowdown_percent": 3.0,
    "list_page_ms": 100.0,
    "history_page_ms": 100.0,
}
ANSWERED = 0.99  # required fraction of the requested reads per second


@dataclass(frozen=True)
class Size:
    """Size of the load test.

    ``runs``: stored runs, each with ``generations`` generations, one with ``longest``; ``rate``: reads per second;
    ``watchers``: number of event streams; ``rounds``: repetitions of each load; ``work``: request of the timed
    calibration.
    """

    runs: int
    generations: int
    longest: int
    rate: float
    watchers: int
    rounds: int
    work: Json

    @property
    def loads(self) -> Sequence[Load]:
        """The loads to apply: the reference, all event streams, and all event streams with reads."""
        # The reference has one event stream, by which the end of the run is noticed.
        return (Load(NONE, 0.0, 1), Load(WATCHED, 0.0, self.watchers), Load(READ, self.rate, self.watchers))


WHOLE = Size(10_000, 100, 20_000, 100.0, 100, 5, LONG)
QUICK = Size(200, 20, 3000, 50.0, 20, 1, SHORT)


def main() -> None:
    """Parse the command line, measure everything, and print one JSON object on the last line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.load", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object on the last line (always done)")
    parser.add_argument("--quick", action="store_true", help="a short run of everything, whose figures mean nothing")
    parser.add_argument("--rounds", type=int, help=f"repetitions of each load (default {WHOLE.rounds})")
    parser.add_argument("--no-ray", action="store_true", help="without Ray nodes")
    options = parser.parse_args()
    start, size = time.monotonic(), QUICK if options.quick else WHOLE
    rounds = options.rounds or size.rounds
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        report = served(Path(scratch), size, rounds)
        if not options.no_ray:
            report["nodes"] = scaling(Path(scratch) / "nodes", size.work, SHORT, max(1, rounds // 2))
            report["node_efficiency"] = report["nodes"]["efficiency"]
    report["missed"] = missed(report)
    report |= {
        "seconds": round(time.monotonic() - start, 1),
        "processor": machine.cpu(),
        "commit": machine.commit(),
        "quick": options.quick,
    }
    print(json.dumps(report))
    sys.exit(1 if report["missed"] else 0)


def served(scratch: Path, size: Size, rounds: int) -> Json:
    """Start a server with a filled database and measure it: response times of pages, then the effect of each load.

    ``rounds``: repetitions of each load. Returns the figures for the report, by name.
    """
    server = Server(scratch, "processes")
    try:
        filled, dataset = _filled(server, size)
        with httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60.0) as http:
            stored = walk(http)
        with Client(f"http://127.0.0.1:{server.port}") as client:
            computed(client, client.submit_run(dataset, **SHORT)["id"])
            long = size.work | {"dataset_id": dataset, "max_generations": 10 * size.work["max_generations"]}
            background = client.submit_run(**long)["id"]
            times = pages(server.port, stored, filled, dataset)
            client.cancel(background)
            client.wait(background)
            found = beside(server, client, size.work | {"dataset_id": dataset}, stored, size.loads, rounds)
        peak_mb = round(server.peak_mb(), 1)
    finally:
        server.stop()
    read = found[READ]
    return {
        "reads_per_second": read["reads_per_second"],
        "read_p99_ms": read["reads"]["p99_ms"],
        "sse_watchers": read["watchers"],
        "sse_p99_ms": read["events"]["p99_ms"],
        "calibration_slowdown_percent": read["slowdown_percent"],
        "list_page_ms": _worst(times, "list"),
        "history_page_ms": _worst(times, "history, first", "history, in", "history, last"),
        "runs_stored": filled.runs,
        "generations_stored": filled.generations,
        "server_us_per_read": per_read_us(read, found[WATCHED]),
        "server_percent_of_a_processor": read["server_percent_of_a_processor"],
        "generator_percent_of_a_processor": read["generator_percent_of_a_processor"],
        "server_peak_mb": peak_mb,
        "beside": found,
        "pages": times,
    }


def missed(report: Json) -> list[str]:
    """Return one line for each figure of ``report`` beyond its limit, and for each kind of failed reads or streams."""
    read = report["beside"][READ]
    faults = [
        f"{name} is {report[name]}, must be at most {limit:g}"
        for name, limit in LIMITS.items()
        if report[name] is None or report[name] > limit
    ]
    if report["reads_per_second"] < ANSWERED * read["requested_per_second"]:
        faults.append(
            f"{report['reads_per_second']:g} of {read['requested_per_second']:g} reads per second were answered"
        )
    for load, found in report["beside"].items():
        faults += [f"{load}: {found[what]} {what}" for what in ("refused", "unanswered", "cut") if found[what]]
    return faults


def _filled(server: Server, size: Size) -> tuple[Filled, str]:
    """Let the server compute a run, copy it many times in the database, and restart the server.

    Returns a description of the filled database, and the id of the uploaded dataset.
    """
    server.start()
    with Client(f"http://127.0.0.1:{server.port}") as client:
        dataset = client.upload_dataset(ROBIRD)["id"]
        computed(client, client.submit_run(dataset, **SHORT)["id"])
    server.stop()
    filled = fill(server.folder / "data", size.runs, size.generations, size.longest)
    server.start()
    return filled, dataset


def _worst(times: Json, *prefixes: str) -> float:
    """Return the largest 99th percentile (ms) of the kinds of pages whose names begin with one of ``prefixes``."""
    return max(float(found["p99_ms"]) for name, found in times.items() if name.startswith(prefixes))


if __name__ == "__main__":
    main()
