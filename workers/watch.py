"""How long a unit may take before its worker is taken to hang, and what became of the workers."""

from __future__ import annotations

import threading
from collections import OrderedDict, deque
from dataclasses import dataclass, replace
from statistics import median

# A unit may take FACTOR times as long as those of its problem mostly do, and SLACK_SECONDS more: individuals near
# divergence take many times the beats of others, and other programs take the processors.
FACTOR, SLACK_SECONDS = 60.0, 10.0
# Until ENOUGH of its problem were done a unit may take as long as one of any other problem, and NEW_SECONDS at least;
# as long as there is no other either, FIRST_SECONDS: kernels may have to be compiled.
ENOUGH, NEW_SECONDS, FIRST_SECONDS = 3, 30.0, 120.0
UNITS_REMEMBERED, PROBLEMS_REMEMBERED = 32, 256
# Losses in a row after which a unit is given up: of workers that had begun it, and of any.
ATTEMPTS, STARTS = 6, 60
# How long a worker may take to start, to load its libraries and to fetch the problem.
START_SECONDS = 120.0


def never() -> bool:
    """No call is given up."""
    return False


class Expectation:
    """How long units mostly take, by their problem: the median, which one that had to compile kernels does not move.

    Safe to use from several threads.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seconds: OrderedDict[str, deque[float]] = OrderedDict()

    def limit(self, key: str, attempt: int = 0) -> float:
        """Seconds after which a unit of the problem ``key`` hangs; twice as many with each attempt at the same unit.

        So a unit that is slow, but honest, is done in the end, and one that never ends is given up.
        """
        with self._lock:
            usual = self._usual(key)
            longest = usual or max(map(self._usual, self._seconds), default=0.0)
        least = 0.0 if usual else NEW_SECONDS if longest else FIRST_SECONDS
        return float(max(least, SLACK_SECONDS + FACTOR * longest) * 2**attempt)

    def usual(self, key: str) -> float:
        """Seconds that a unit of the problem ``key`` mostly takes; 0 while that is not known."""
        with self._lock:
            return self._usual(key)

    def _usual(self, key: str) -> float:
        """The median of the problem's units; 0 where too few were done."""
        known = self._seconds.get(key, ())
        return median(known) if len(known) >= ENOUGH else 0.0

    def done(self, key: str, seconds: float) -> None:
        """One unit took ``seconds``."""
        with self._lock:
            self._seconds.setdefault(key, deque(maxlen=UNITS_REMEMBERED)).append(seconds)
            self._seconds.move_to_end(key)
            while len(self._seconds) > PROBLEMS_REMEMBERED:
                self._seconds.popitem(last=False)


@dataclass(frozen=True)
class Standing:
    """What an evaluator's workers are and were.

    Attributes:
        workers: that live now.
        died: workers that ended by themselves, or whose machine was lost.
        hung: workers that were ended because a unit took longer than its limit.
        restarts: workers that were started in place of others.
    """

    workers: int
    died: int = 0
    hung: int = 0
    restarts: int = 0


class Tally:
    """Counts what becomes of workers; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counted = Standing(0)

    def count(self, *, died: int = 0, hung: int = 0, restarts: int = 0) -> None:
        """Add to the counts."""
        with self._lock:
            was = self._counted
            self._counted = Standing(0, was.died + died, was.hung + hung, was.restarts + restarts)

    def standing(self, workers: int) -> Standing:
        """The counts, with the number of ``workers`` that live."""
        with self._lock:
            return replace(self._counted, workers=workers)
