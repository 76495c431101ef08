"""The batches of one call on Ray: handed out as workers come free, and done again where a worker was lost.

Nothing is ever cancelled: in Ray 2.60 a cancellation that meets the end of its task aborts this process. So no more
batches are under way than keep the workers busy, and what a call that is given up leaves behind is soon done.
A worker that hangs ends itself (:mod:`wingfit.workers.guardian`). A batch whose worker or node is lost is done again
from here and not by Ray, which would say nothing of it.
"""

from __future__ import annotations

import logging
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from wingfit.calibration.problem import Misfit, Problem
from wingfit.workers.errors import WorkerLostError
from wingfit.workers.ray_connection import ray, ray_errors
from wingfit.workers.watch import ATTEMPTS, STARTS, Expectation, Tally

LOG = logging.getLogger("wingfit.workers")
POLL_SECONDS = 0.2
# Batches of one call: as many, or so many that each takes no longer than a moment; of a problem that is not known yet,
# a few tasks each.
PER_WORKER, BATCH_SECONDS, UNKNOWN_TASKS = 3, 2.0, 8
# Of them under way at a time: the next one lies ready when a worker is done.
UNDER_WAY = 2
# A cluster that loses nodes is given time to get new ones.
LONGEST_PAUSE = 30.0
# What ends a worker at its work; all else is trouble of the cluster, and no fault of the batch.
OF_THE_WORKER = (ray_errors.WorkerCrashedError, ray_errors.OutOfMemoryError)


@dataclass
class Batch:
    """Tasks that travel together, by their numbers.

    Attributes:
        blamed: workers that were lost while they worked on it.
        lost: workers and nodes that were lost with it.
        due: when it may be submitted.
        limit: s that one of its tasks may take, when it was submitted last, at ``began``.
    """

    numbers: tuple[int, ...]
    blamed: int = 0
    lost: int = 0
    due: float = 0.0
    limit: float = 0.0
    began: float = 0.0


class Cluster(NamedTuple):
    """What a call needs of the cluster.

    ``submit(batch, limit)`` gives a reference to what becomes of it, ``forget`` says that the problem was lost there,
    and ``check`` raises when the call is to end.
    """

    workers: Callable[[], int]
    submit: Callable[[Batch, float], Any]
    forget: Callable[[], None]
    check: Callable[[], None]


class Batches:
    """The ``count`` tasks of one call for ``problem``."""

    def __init__(self, problem: Problem, count: int, cluster: Cluster, expectation: Expectation, tally: Tally) -> None:
        self._problem, self._count, self._cluster = problem, count, cluster
        self._expectation, self._tally = expectation, tally
        seconds = expectation.usual(problem.key) or BATCH_SECONDS / UNKNOWN_TASKS
        hands = min(count, max(PER_WORKER * max(1, cluster.workers()), math.ceil(count * seconds / BATCH_SECONDS)))
        # Dealt out like cards, so that recordings that cost more are spread over all batches.
        self._waiting = deque(Batch(tuple(range(first, count, hands))) for first in range(hands))
        self._pending: dict[Any, Batch] = {}
        self._done: dict[int, Misfit] = {}

    def collect(self) -> list[Misfit]:
        """What became of all tasks, in their order."""
        while self._waiting or self._pending:
            self._cluster.check()
            self._submit()
            for reference in self._ready():
                self._take(reference, self._pending.pop(reference))
        return [self._done[number] for number in range(self._count)]

    def _submit(self) -> None:
        now = time.monotonic()
        for _ in range(len(self._waiting)):
            if len(self._pending) >= UNDER_WAY * max(1, self._cluster.workers()):
                return
            batch = self._waiting.popleft()
            if batch.due > now:
                self._waiting.append(batch)
                continue
            batch.began, batch.limit = now, self._expectation.limit(self._problem.key, batch.blamed)
            self._pending[self._cluster.submit(batch, batch.limit)] = batch

    def _ready(self) -> list[Any]:
        if not self._pending:
            time.sleep(POLL_SECONDS)
            return []
        ready, rest = ray.wait(list(self._pending), num_returns=1, timeout=POLL_SECONDS)
        more = ray.wait(rest, num_returns=len(rest), timeout=0)[0] if ready and rest else []
        return [*ready, *more]

    def _take(self, reference: Any, batch: Batch) -> None:
        try:
            answers: list[tuple[Misfit, float]] = ray.get(reference)
        except ray_errors.RayTaskError as error:
            cause = error.cause
            if not isinstance(cause, ray_errors.RayError):
                raise (cause if isinstance(cause, Exception) else RuntimeError(str(error))) from error
            # The worker lives, and could not get at the problem.
            self._cluster.forget()
            self._lost(batch, cause)
        except ray_errors.RayError as error:
            self._tally.count(**{"hung" if _hung(batch, error) else "died": 1}, restarts=1)
            self._lost(batch, error)
        else:
            for number, (misfit, seconds) in zip(batch.numbers, answers, strict=True):
                self._done[number] = misfit
                self._expectation.done(self._problem.key, seconds)

    def _lost(self, batch: Batch, error: Exception) -> None:
        """Do the batch again, some time later where the cluster is in trouble; WorkerLostError if that is no use."""
        self._cluster.check()
        now = time.monotonic()
        what = f"{len(batch.numbers)} units of {self._problem.key[:8]} over {len(self._problem.recordings)} recordings"
        reason = f"{type(error).__name__}: {error}"
        if _hung(batch, error):
            reason = f"it died, or it was ended because it took more than {batch.limit:.0f} s for one"
        LOG.warning("lost on Ray after %.1f s: %s (%s); they are done again", now - batch.began, what, reason)
        batch.lost += 1
        if isinstance(error, OF_THE_WORKER):
            batch.blamed += 1
        else:
            batch.due = now + min(2.0 ** (batch.lost - 1), LONGEST_PAUSE)
        if batch.blamed >= ATTEMPTS or batch.lost >= STARTS:
            raise WorkerLostError(
                f"{batch.lost} Ray workers were lost one after the other with the same {what}, the last because: "
                f"{reason}; if memory ran out, use fewer workers than {self._cluster.workers()}"
            ) from error
        self._waiting.append(batch)


def _hung(batch: Batch, error: Exception) -> bool:
    """Whether its worker seems to have been ended for a task that took too long; who ended it, Ray does not say."""
    return isinstance(error, ray_errors.WorkerCrashedError) and time.monotonic() - batch.began >= batch.limit
