"""Record of what the server acknowledged, and of what it lost."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

Json = dict[str, Any]
TIMES = ("elapsed_seconds", "eta_seconds")


@dataclass
class KnownRun:
    """A run whose submission was acknowledged.

    Attributes:
        work: name of its workload.
        generations: entries of its history, by sequence number, as first seen.
        endings: allowed final states: at first SUCCEEDED; also CANCELLED once a cancellation was requested; only
            CANCELLED once the cancellation was acknowledged.
        final: its final state; None until a client has seen it.
    """

    work: str
    generations: dict[int, Json] = field(default_factory=dict)
    endings: tuple[str, ...] = ("SUCCEEDED",)
    final: str | None = None


@dataclass
class Ledger:
    """Record of everything that the server acknowledged, and of losses; shared by all clients, thread-safe.

    Attributes:
        datasets: SHA-256 of each uploaded archive, by id of the dataset.
        runs: submitted runs, by id.
        diagnoses: final state of each diagnosis by id; None until a client has seen it.
        lost: descriptions of losses.
        acknowledged: number of acknowledged requests and stored generations.
        results: number of results compared with undisturbed ones, of which ``identical`` were equal.
        different: ids of jobs with other results.
    """

    datasets: dict[str, str] = field(default_factory=dict)
    runs: dict[str, KnownRun] = field(default_factory=dict)
    diagnoses: dict[str, str | None] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    acknowledged: int = 0
    results: int = 0
    identical: int = 0
    different: list[str] = field(default_factory=list)
    lock: threading.RLock = field(default_factory=threading.RLock)

    def lose(self, what: str) -> None:
        """Record the loss or change of something acknowledged; ``what``: its description."""
        with self.lock:
            self.lost.append(what)

    def acknowledge(self) -> None:
        """Count one more acknowledged request."""
        with self.lock:
            self.acknowledged += 1

    def history(self, run: str, items: list[Json]) -> None:
        """Compare the history ``items`` of a run with the entries seen before; changed or missing entries are losses.

        New entries are stored.
        """
        with self.lock:
            seen = self.runs[run].generations
            now = {item["sequence"]: without_times(item) for item in items}
            for sequence, item in seen.items():
                if now.get(sequence) != item:
                    self.lost.append(f"run {run}: generation {sequence} was {item}, is {now.get(sequence)}")
            self.acknowledged += len(now.keys() - seen.keys())
            seen.update(now)

    def result(self, run: str, found: Json, expected: Json) -> None:
        """Compare the result ``found`` of the run or diagnosis ``run`` (id) with the undisturbed one; count it."""
        with self.lock:
            self.results += 1
            self.identical += found == expected
            if found != expected:
                self.different.append(run)


def without_times(item: Json) -> Json:
    """Return a copy of a JSON object without the fields of times, which differ between equal runs."""
    return {key: value for key, value in item.items() if key not in TIMES}
