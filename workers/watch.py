"""Time limits of units of work, beyond which their worker counts as hung, and counts of lost workers."""

from __future__ import annotations

import threading
from collections import Counter, deque
from dataclasses import dataclass
from statistics import median
from typing import Literal

from wingfit.workers.recent import Recent

# Limit of a unit: FACTOR times the median of its problem plus SLACK_SECONDS. Individuals near divergence need many
# times the beats of others, and other programs use the processors too.
FACTOR, SLACK_SECONDS = 60.0, 10.0
# Before ENOUGH units of a problem are done, the longest median of the other problems is used, with a limit of at least
# NEW_SECONDS; without other problems at least FIRST_SECONDS, because kernels may have to be compiled.
ENOUGH, NEW_SECONDS, FIRST_SECONDS = 3, 30.0, 120.0
UNITS_REMEMBERED, PROBLEMS_REMEMBERED = 32, 256
# A unit is given up after ATTEMPTS losses of workers that had started it, or STARTS losses of any.
ATTEMPTS, STARTS = 6, 60
# Time limit for a worker to start, load its libraries and fetch the problem.
START_SECONDS = 120.0


def never() -> bool:
    """Return False: the default of the argument ``interrupted``, with which no call is interrupted."""
    return False


class Expectation:
    """Derives time limits of units of work from the median duration of earlier units, by problem. Thread-safe.

    The median is hardly affected by a unit in which kernels were compiled. A problem is named by its ``key``.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seconds = Recent[deque[float]](PROBLEMS_REMEMBERED)

    def limit(self, key: str, attempt: int = 0) -> float:
        """Return the time limit (s) of a unit of problem ``key``, doubled with each repeated ``attempt`` (0, 1, 2 ...).

        The doubling lets a slow unit finish in the end; callers limit the number of attempts.
        """
        with self._lock:
            usual = self._usual(key)
            longest = usual or max(map(self._usual, self._seconds), default=0.0)
        least = 0.0 if usual else NEW_SECONDS if longest else FIRST_SECONDS
        return float(max(least, SLACK_SECONDS + FACTOR * longest) * 2**attempt)

    def usual(self, key: str) -> float:
        """Return the median duration (s) of a unit of problem ``key``; 0 if unknown."""
        with self._lock:
            return self._usual(key)

    def _usual(self, key: str) -> float:
        """Return the same as :meth:`usual`, 0 with fewer than ENOUGH finished units; the caller must hold the lock."""
        known = self._seconds.get(key, ())
        return median(known) if len(known) >= ENOUGH else 0.0

    def done(self, key: str, seconds: float) -> None:
        """Record that a unit of problem ``key`` took ``seconds``."""
        with self._lock:
            self._seconds.use(key, lambda: deque(maxlen=UNITS_REMEMBERED)).append(seconds)


@dataclass(frozen=True)
class Standing:
    """Counts of the workers of an evaluator.

    Attributes:
        workers: number that live now.
        died: workers that ended by themselves, or whose machine was lost.
        hung: workers that were killed because a unit exceeded its time limit.
        restarts: workers that were started as replacements.
    """

    workers: int
    died: int = 0
    hung: int = 0
    restarts: int = 0


class Tally:
    """Counts of lost workers; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()

    def replaced(self, loss: Literal["died", "hung"]) -> None:
        """Count one worker that died or hung, and was replaced."""
        with self._lock:
            self._counts.update([loss, "restarts"])

    def standing(self, workers: int) -> Standing:
        """Return the counts, together with the number of living ``workers``."""
        with self._lock:
            return Standing(workers, **self._counts)
