"""Sends the tasks of one call to Ray in batches, as workers become free, and repeats a batch if its worker is lost.

Submitted batches are never cancelled: in Ray 2.60, cancelling a task at the moment it ends aborts this process. So only
as many batches are submitted as keep the workers busy, and the batches of an interrupted call soon end. A hung worker
is killed on its own machine (:mod:`wingfit.workers.guardian`). A batch whose worker or node (machine) is lost is
repeated by this module and not by Ray, which would not report the loss.
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
# Number of batches of one call: PER_WORKER per worker, or more so that each takes at most BATCH_SECONDS; for a problem
# of unknown duration, UNKNOWN_TASKS in each.
PER_WORKER, BATCH_SECONDS, UNKNOWN_TASKS = 3, 2.0, 8
# Submitted batches per worker, so that the next one is there when a worker is done.
UNDER_WAY = 2
# Longest wait (s) before a batch is repeated, for a cluster to replace lost nodes.
LONGEST_PAUSE = 30.0
# Errors that the batch itself may have caused; all others are errors of the cluster.
OF_THE_WORKER = (ray_errors.WorkerCrashedError, ray_errors.OutOfMemoryError)


@dataclass
class Batch:
    """Tasks that are sent to one Ray worker together.

    Attributes:
        numbers: indices of the tasks in the call.
        blamed: number of workers lost by a crash or for lack of memory, which the batch may have caused.
        lost: number of all losses of a worker, a node or the stored problem while the batch was submitted.
        due: time (s, monotonic clock) before which the batch must not be submitted again.
        limit: time limit (s) of each of its tasks in the last submission.
        began: time (s, monotonic clock) of the last submission.
    """

    numbers: tuple[int, ...]
    blamed: int = 0
    lost: int = 0
    due: float = 0.0
    limit: float = 0.0
    began: float = 0.0


class Cluster(NamedTuple):
    """Functions with which :class:`Batches` uses the Ray cluster.

    ``workers()`` returns the number of processors; ``submit(batch, limit)`` submits a batch whose tasks have the time
    limit ``limit`` (s) and returns Ray's reference to the result; ``forget()`` is called if the cluster has lost the
    stored problem; ``check()`` raises if the evaluator was closed or the call is interrupted.
    """

    workers: Callable[[], int]
    submit: Callable[[Batch, float], Any]
    forget: Callable[[], None]
    check: Callable[[], None]


class Batches:
    """Submits the ``count`` tasks of one call of ``evaluate`` for ``problem`` in batches, and collects their results.

    ``expectation`` gives time limits, and learns from the durations of tasks; ``tally`` counts lost workers.
    """

    def __init__(self, problem: Problem, count: int, cluster: Cluster, expectation: Expectation, tally: Tally) -> None:
        self._problem, self._count, self._cluster = problem, count, cluster
        self._expectation, self._tally = expectation, tally
        seconds = expectation.usual(problem.key) or BATCH_SECONDS / UNKNOWN_TASKS
        hands = min(count, max(PER_WORKER * max(1, cluster.workers()), math.ceil(count * seconds / BATCH_SECONDS)))
        # Distributed in turn, so that expensive recordings are spread over all batches.
        self._waiting = deque(Batch(tuple(range(first, count, hands))) for first in range(hands))
        self._pending: dict[Any, Batch] = {}
        self._done: dict[int, Misfit] = {}

    def collect(self) -> list[Misfit]:
        """Evaluate all tasks, and return their misfits in the order of the tasks."""
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
            # The worker lives, but could not fetch the problem.
            self._cluster.forget()
            self._lost(batch, cause)
        except ray_errors.RayError as error:
            self._tally.replaced("hung" if _hung(batch, error) else "died")
            self._lost(batch, error)
        else:
            for number, (misfit, seconds) in zip(batch.numbers, answers, strict=True):
                self._done[number] = misfit
                self._expectation.done(self._problem.key, seconds)

    def _lost(self, batch: Batch, error: Exception) -> None:
        """Queue a lost batch again, with a delay unless its worker crashed; WorkerLostError after too many losses."""
        self._cluster.check()
        now = time.monotonic()
        what = f"{len(batch.numbers)} units of {self._problem.key[:8]} over {len(self._problem.recordings)} recordings"
        reason = f"{type(error).__name__}: {error}"
        if _hung(batch, error):
            reason = f"it died, or was killed because a unit took more than {batch.limit:.0f} s"
        LOG.warning("lost on Ray after %.1f s: %s (%s); they are repeated", now - batch.began, what, reason)
        batch.lost += 1
        if isinstance(error, OF_THE_WORKER):
            batch.blamed += 1
        else:
            batch.due = now + min(2.0 ** (batch.lost - 1), LONGEST_PAUSE)
        if batch.blamed >= ATTEMPTS or batch.lost >= STARTS:
            raise WorkerLostError(
                f"{batch.lost} Ray workers were lost one after the other with the same {what}; the last one: "
                f"{reason}; if memory ran out, use fewer workers than {self._cluster.workers()}"
            ) from error
        self._waiting.append(batch)


def _hung(batch: Batch, error: Exception) -> bool:
    """Return whether the worker was probably killed at the time limit; Ray does not report who killed it."""
    return isinstance(error, ray_errors.WorkerCrashedError) and time.monotonic() - batch.began >= batch.limit
