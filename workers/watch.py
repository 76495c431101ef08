"""How long a unit may take before its worker is taken to hang, and what became of the workers."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace

# A unit may take FACTOR times as long as the longest one of its problem that was done so far, and SLACK_SECONDS more:
# individuals near divergence take more beats than others, and other programs take the processors.
FACTOR, SLACK_SECONDS = 20.0, 10.0
# The first of its problem may take as long as any other problem's, and NEW_SECONDS at least; the very first, for which
# kernels may have to be compiled, FIRST_SECONDS.
NEW_SECONDS, FIRST_SECONDS = 30.0, 120.0
PROBLEMS_REMEMBERED = 256


class Expectation:
    """How long units take, by their problem; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._longest: OrderedDict[str, float] = OrderedDict()

    def limit(self, key: str, attempt: int = 0) -> float:
        """Seconds after which a unit of the problem ``key`` hangs; twice as many with each attempt at the same unit.

        So a unit that is slow, but honest, is done in the end, and one that never ends is given up.
        """
        with self._lock:
            longest = self._longest.get(key, max(self._longest.values(), default=None))
            least = FIRST_SECONDS if longest is None else 0.0 if key in self._longest else NEW_SECONDS
        return float(max(least, SLACK_SECONDS + FACTOR * (longest or 0.0)) * 2**attempt)

    def done(self, key: str, seconds: float) -> None:
        """One unit took ``seconds``."""
        with self._lock:
            self._longest[key] = max(seconds, self._longest.get(key, 0.0))
            self._longest.move_to_end(key)
            while len(self._longest) > PROBLEMS_REMEMBERED:
                self._longest.popitem(last=False)


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
