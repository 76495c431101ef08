"""What was acknowledged, by whom it must still be known, and what of it was lost."""

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
        work: name of what it computes.
        generations: of its history, by sequence, as they were first seen.
        endings: what may become of it: SUCCEEDED; also CANCELLED once that was asked, and that alone once acknowledged.
        final: its state, once seen to have ended.
    """

    work: str
    generations: dict[int, Json] = field(default_factory=dict)
    endings: tuple[str, ...] = ("SUCCEEDED",)
    final: str | None = None


@dataclass
class Ledger:
    """All that was acknowledged so far; safe to use from several threads."""

    datasets: dict[str, str] = field(default_factory=dict)
    runs: dict[str, KnownRun] = field(default_factory=dict)
    diagnoses: dict[str, str | None] = field(default_factory=dict)
    """State of each once seen to have ended."""
    lost: list[str] = field(default_factory=list)
    acknowledged: int = 0
    results: int = 0
    identical: int = 0
    different: list[str] = field(default_factory=list)
    lock: threading.RLock = field(default_factory=threading.RLock)

    def lose(self, what: str) -> None:
        """Something that was acknowledged is not as it was."""
        with self.lock:
            self.lost.append(what)

    def acknowledge(self) -> None:
        """Count one more answer that must be kept."""
        with self.lock:
            self.acknowledged += 1

    def history(self, run: str, items: list[Json]) -> None:
        """Compare a history with what was seen of it before, and remember it."""
        with self.lock:
            seen = self.runs[run].generations
            now = {item["sequence"]: without_times(item) for item in items}
            for sequence, item in seen.items():
                if now.get(sequence) != item:
                    self.lost.append(f"run {run}: generation {sequence} was {item}, is {now.get(sequence)}")
            self.acknowledged += len(now.keys() - seen.keys())
            seen.update(now)

    def result(self, run: str, found: Json, expected: Json) -> None:
        """Compare how a run or a diagnosis ended with how an undisturbed one did."""
        with self.lock:
            self.results += 1
            self.identical += found == expected
            if found != expected:
                self.different.append(run)


def without_times(item: Json) -> Json:
    """``item`` without what a clock says."""
    return {key: value for key, value in item.items() if key not in TIMES}
