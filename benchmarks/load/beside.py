"""The same calibration again and again, undisturbed and under loads, in turn: what each costs the other.

The same seed gives the same computation, bit for bit. So the times of two runs differ by what went on beside them, and
by what else this machine does: hence in turn, and the order of the turns is reversed from round to round.
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
from benchmarks.load.crowd import Crowd, Told, visit
from benchmarks.load.figures import milliseconds
from benchmarks.load.mix import KINDS, Stored, reads
from wingfit.client.client import Client

Json = dict[str, Any]
READS = 20_000  # drawn; then again from the first
TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Load:
    """Reads per second, and watchers of the run."""

    name: str
    rate: float
    watchers: int


@dataclass(frozen=True)
class Turn:
    """One calibration under one load.

    Attributes:
        seconds: from its first generation to its last.
        evaluations: in that time.
        processor_seconds: of the server without its workers, from before the run to after.
        kinds: of the reads, by the number of their path.
        told: by the crowd.
    """

    seconds: float
    evaluations: int
    processor_seconds: float
    kinds: Sequence[str]
    told: Told


def beside(server: Server, client: Client, body: Json, stored: Stored, loads: Sequence[Load], rounds: int) -> Json:
    """Take turns, the first of ``loads`` being none, and say of each load what it met with and what it cost."""
    turns: dict[str, list[Turn]] = {load.name: [] for load in loads}
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as crowd:
        crowd.submit(os.getpid).result()  # it starts before it is needed

        def come(what: Crowd) -> Told:
            return crowd.submit(visit, what).result()

        for number in range(rounds):
            for load in loads if number % 2 == 0 else reversed(loads):
                _progress(f"round {number + 1} of {rounds}, {load.name}")
                turns[load.name].append(_turn(server, client, body, stored, load, number, come))
    _progress("")
    alone = turns[loads[0].name]
    return {load.name: _told(load, turns[load.name], alone) for load in loads}


def _turn(
    server: Server,
    client: Client,
    body: Json,
    stored: Stored,
    load: Load,
    seed: int,
    come: Callable[[Crowd], Told],
) -> Turn:
    before = processor_seconds(server.pid)
    run = client.submit_run(**body)["id"]
    asked = reads(stored, run, READS, seed) if load.rate else []
    told = come(Crowd(server.port, run, load.watchers, load.rate, [path for _, path in asked]))
    after = processor_seconds(server.pid)
    return Turn(*computed(client, run), after - before, [kind for kind, _ in asked], told)


def _told(load: Load, turns: Sequence[Turn], alone: Sequence[Turn]) -> Json:
    """Of one load, over all its turns, beside those of the undisturbed run of the same rounds."""
    told = [turn.told for turn in turns]
    latencies = [seconds for one in told for _, seconds in one.latencies]
    slowdowns = [100 * (turn.seconds / other.seconds - 1) for turn, other in zip(turns, alone, strict=True)]
    lasted, reading = (sum(getattr(one, name) for one in told) for name in ("seconds", "reading_seconds"))
    taken = sum(turn.processor_seconds - other.processor_seconds for turn, other in zip(turns, alone, strict=True))
    own, others_own = (sum(turn.told.processor_seconds for turn in some) for some in (turns, alone))
    return {
        "asked_per_second": load.rate,
        "watchers": load.watchers,
        "calibration_seconds": [round(turn.seconds, 2) for turn in turns],
        "evaluations_per_second": round(statistics.median(turn.evaluations / turn.seconds for turn in turns), 2),
        "slowdown_percent": round(statistics.median(slowdowns), 1),
        "slowdowns_percent": [round(one, 1) for one in slowdowns],
        "reads_per_second": round(len(latencies) / reading, 1) if reading else 0.0,
        "reads": milliseconds(latencies) | {"of": len(latencies)},
        "reads_by_kind": {kind: milliseconds(_of_kind(turns, kind)) for kind in KINDS} if latencies else {},
        "events": milliseconds(lags := [lag for one in told for lag in one.lags]) | {"of": len(lags)},
        "refused": sum(one.refused for one in told),
        "unanswered": sum(one.unanswered for one in told),
        "cut": sum(one.cut for one in told),
        "crowd_late_ms": round(1e3 * max(one.late for one in told), 1),
        "server_processor_seconds": round(taken, 2),
        "crowd_processor_seconds": round(own - others_own, 2),
        "server_percent_of_a_processor": round(100 * taken / lasted, 1),
        "crowd_percent_of_a_processor": round(100 * (own - others_own) / lasted, 1),
    }


def per_read_us(loaded: Json, watched: Json) -> float | None:
    """Processor time of the server for a read: what it took more than for the watchers alone."""
    number = loaded["reads"]["of"]
    more = loaded["server_processor_seconds"] - watched["server_processor_seconds"]
    return round(1e6 * more / number, 1) if number else None


def processor_seconds(pid: int) -> float:
    """That a process has taken, with its threads and without the processes that it started."""
    fields = (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def _of_kind(turns: Sequence[Turn], kind: str) -> list[float]:
    return [seconds for turn in turns for number, seconds in turn.told.latencies if turn.kinds[number] == kind]


def _progress(what: str) -> None:
    print(f"\r{what:60s}", end="" if what else "\n", file=sys.stderr, flush=True)
