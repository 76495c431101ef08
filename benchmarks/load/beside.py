"""Runs the same calibration with and without each load, to measure how much each slows the other.

The same seed gives the same computation, bit for bit, so the times of two runs differ only by the load and by other
work on the machine. To average over slow changes of that work the loads alternate, in reversed order every second
round.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.server_process import Server
from benchmarks.load.calibrations import computed
from benchmarks.load.figures import milliseconds
from benchmarks.load.generator import Observed, Traffic, generate
from benchmarks.load.mix import KINDS, Stored, reads
from wingfit.client.client import Client

Json = dict[str, Any]
READS = 20_000  # different reads of a trial; after the last, they are repeated from the first
TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Load:
    """A load to apply during a calibration; ``rate``: reads per second; ``watchers``: event streams of the run."""

    name: str
    rate: float
    watchers: int


@dataclass(frozen=True)
class Trial:
    """One calibration beside one load.

    Attributes:
        seconds: from the first generation to the last.
        evaluations: number of simulated individuals in that time.
        processor_seconds: processor time of the server without its workers, from before the run to after it.
        kinds: kind of each read ("run", "list" or "history"), by the index of its path in the load generator's list.
        observed: response times and losses, as measured by the load generator.
    """

    seconds: float
    evaluations: int
    processor_seconds: float
    kinds: Sequence[str]
    observed: Observed


def beside(server: Server, client: Client, body: Json, stored: Stored, loads: Sequence[Load], rounds: int) -> Json:
    """Run the same calibration under each of ``loads``, ``rounds`` times, and return the figures by name of the load.

    ``body``: request of the calibration; ``stored``: stored runs that are read. The first load, without reads, is the
    reference for slowdowns.
    """
    trials: dict[str, list[Trial]] = {load.name: [] for load in loads}
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        pool.submit(os.getpid).result()  # start the process before it is needed

        def run_traffic(traffic: Traffic) -> Observed:
            return pool.submit(generate, traffic).result()

        for number in range(rounds):
            for load in loads if number % 2 == 0 else reversed(loads):
                _progress(f"round {number + 1} of {rounds}, {load.name}")
                trials[load.name].append(_trial(server, client, body, stored, load, number, run_traffic))
    _progress("")
    alone = trials[loads[0].name]
    return {load.name: _figures(load, trials[load.name], alone) for load in loads}


def _trial(
    server: Server,
    client: Client,
    body: Json,
    stored: Stored,
    load: Load,
    seed: int,
    run_traffic: Callable[[Traffic], Observed],
) -> Trial:
    """Submit the calibration ``body``, apply ``load`` until it ends, and measure both; ``seed``: of the drawn reads."""
    before = processor_seconds(server.pid)
    run = client.submit_run(**body)["id"]
    requests = reads(stored, run, READS, seed) if load.rate else []
    observed = run_traffic(Traffic(server.port, run, load.watchers, load.rate, [path for _, path in requests]))
    after = processor_seconds(server.pid)
    return Trial(*computed(client, run), after - before, [kind for kind, _ in requests], observed)


def _figures(load: Load, trials: Sequence[Trial], alone: Sequence[Trial]) -> Json:
    """Return the figures of the report for one load.

    ``trials``: those with this load; ``alone``: those of the reference load in the same rounds.
    """
    observed = [trial.observed for trial in trials]
    latencies = [seconds for one in observed for _, seconds in one.latencies]
    slowdowns = [100 * (trial.seconds / other.seconds - 1) for trial, other in zip(trials, alone, strict=True)]
    lasted, reading = (sum(getattr(one, name) for one in observed) for name in ("seconds", "reading_seconds"))
    taken = sum(trial.processor_seconds - other.processor_seconds for trial, other in zip(trials, alone, strict=True))
    own, alone_own = (sum(trial.observed.processor_seconds for trial in some) for some in (trials, alone))
    return {
        "requested_per_second": load.rate,
        "watchers": load.watchers,
        "calibration_seconds": [round(trial.seconds, 2) for trial in trials],
        "evaluations_per_second": round(statistics.median(trial.evaluations / trial.seconds for trial in trials), 2),
        "slowdown_percent": round(statistics.median(slowdowns), 1),
        "slowdowns_percent": [round(one, 1) for one in slowdowns],
        "reads_per_second": round(len(latencies) / reading, 1) if reading else 0.0,
        "reads": milliseconds(latencies) | {"of": len(latencies)},
        "reads_by_kind": {kind: milliseconds(_of_kind(trials, kind)) for kind in KINDS} if latencies else {},
        "events": milliseconds(lags := [lag for one in observed for lag in one.lags]) | {"of": len(lags)},
        "refused": sum(one.refused for one in observed),
        "unanswered": sum(one.unanswered for one in observed),
        "cut": sum(one.cut for one in observed),
        "generator_late_ms": round(1e3 * max(one.late for one in observed), 1),
        "server_processor_seconds": round(taken, 2),
        "generator_processor_seconds": round(own - alone_own, 2),
        "server_percent_of_a_processor": round(100 * taken / lasted, 1),
        "generator_percent_of_a_processor": round(100 * (own - alone_own) / lasted, 1),
    }


def per_read_us(loaded: Json, watched: Json) -> float | None:
    """Return the processor time of the server per read, in microseconds; None if there were no reads.

    ``loaded``: figures of the load with event streams and reads; ``watched``: of the load with event streams only.
    """
    number = loaded["reads"]["of"]
    more = loaded["server_processor_seconds"] - watched["server_processor_seconds"]
    return round(1e6 * more / number, 1) if number else None


def processor_seconds(pid: int) -> float:
    """Return the processor time (s) so far of the process ``pid``, without the processes that it started."""
    fields = (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def _of_kind(trials: Sequence[Trial], kind: str) -> list[float]:
    """Return the response times (s) of the reads of one ``kind`` in all ``trials``."""
    return [seconds for trial in trials for number, seconds in trial.observed.latencies if trial.kinds[number] == kind]


def _progress(what: str) -> None:
    print(f"\r{what:60s}", end="" if what else "\n", file=sys.stderr, flush=True)
