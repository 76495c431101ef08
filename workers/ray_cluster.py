"""Evaluates individuals with Ray, on this machine or on an existing cluster.

Arrays in Ray's shared memory are read-only, another type for compiled kernels; so a problem is sent as pickled bytes.
A call to Ray costs milliseconds, so units of work are sent in batches, a few per processor. Ray's default strategy
sends all batches to the node that had the previous ones; so the strategy "SPREAD" is given.
"""

from __future__ import annotations

import logging
import pickle
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, Literal

from wingfit.calibration.problem import Misfit, Problem
from wingfit.workers.guardian import Guardian
from wingfit.workers.ray_batches import Batch, Batches, Cluster
from wingfit.workers.ray_connection import Connection, ray
from wingfit.workers.recent import Recent
from wingfit.workers.running_evaluator import Interrupted, RunningEvaluator
from wingfit.workers.share import PROBLEMS_KEPT, Task, lower_priority, received
from wingfit.workers.watch import START_SECONDS, Expectation, Standing, Tally

LOG = logging.getLogger("wingfit.workers")
STOP_SECONDS = 30.0
LOOK_SECONDS = 2.0
# After this time without an answer the head, and with it all workers, count as lost.
STALE_SECONDS = 20.0


class RayEvaluator(RunningEvaluator):
    """Evaluates batches on the Ray cluster at ``address`` or, if that is None, in ``workers`` local processes."""

    kind: Literal["ray"] = "ray"

    def __init__(self, workers: int | None = None, address: str | None = None) -> None:
        self._connection = Connection(workers, address)
        self._condition = threading.Condition()
        self._calls = 0
        self._references = Recent[Any](PROBLEMS_KEPT)
        # No retries by Ray, which would not report them.
        self._run_tasks = ray.remote(num_cpus=1, max_retries=0, scheduling_strategy="SPREAD")(_run_tasks)
        self._expectation, self._tally = Expectation(), Tally()
        self._workers, self._seen = _count_workers(), time.monotonic()
        self._over = threading.Event()
        threading.Thread(target=self._look, name="ray-watch", daemon=True).start()

    @property
    def workers(self) -> int:
        """Number of processors of the cluster a few seconds ago; 0 if its head (main process) does not answer."""
        return self._workers if time.monotonic() - self._seen < STALE_SECONDS else 0

    @property
    def standing(self) -> Standing:
        """Number of processors of the cluster, and counts of lost workers."""
        return self._tally.standing(self.workers)

    def _misfits(self, problem: Problem, tasks: list[Task], residuals: bool, interrupted: Interrupted) -> list[Misfit]:
        def submit(batch: Batch, limit: float) -> Any:
            mine = [tasks[number] for number in batch.numbers]
            return self._run_tasks.remote(problem.key, [self._put(problem)], mine, limit, residuals)

        check, forget = partial(self._check, interrupted), partial(self._forget, problem)
        with self._call():
            cluster = Cluster(lambda: self.workers, submit, forget, check)
            return Batches(problem, len(tasks), cluster, self._expectation, self._tally).collect()

    def close(self) -> None:
        """Leave the cluster; a Ray that was started here is stopped. Calls in progress raise EvaluatorClosedError."""
        with self._condition:
            if self._closed:
                return
            self._closed = True
            self._over.set()
            # Ray must not be stopped while a call still uses it.
            self._condition.wait_for(lambda: self._calls == 0, STOP_SECONDS)
            self._references.clear()
        self._connection.close()

    @contextmanager
    def _call(self) -> Iterator[None]:
        with self._condition:
            self._check()
            self._calls += 1
        try:
            yield
        finally:
            with self._condition:
                self._calls -= 1
                self._condition.notify_all()

    def _look(self) -> None:
        """Count the cluster's processors every few seconds; in its own thread, as a lost head blocks the query."""
        while not self._over.wait(LOOK_SECONDS):
            # Without a head Ray raises various errors; the count becomes stale then.
            with suppress(Exception), self._call():
                count = _count_workers()
                if not count and self._workers:
                    LOG.warning("the Ray cluster has no workers left; evaluations wait until one joins")
                self._workers, self._seen = count, time.monotonic()

    def _put(self, problem: Problem) -> Any:
        """Store ``problem`` in the cluster's memory unless it is there already; return Ray's reference to it."""
        with self._condition:
            return self._references.use(problem.key, lambda: ray.put(pickle.dumps(problem, pickle.HIGHEST_PROTOCOL)))

    def _forget(self, problem: Problem) -> None:
        """Discard the reference to ``problem``, which the cluster lost, so that :meth:`_put` stores it again."""
        with self._condition:
            self._references.pop(problem.key, None)


def _count_workers() -> int:
    return int(ray.cluster_resources().get("CPU", 0))


def _fetched(reference: Any) -> Problem:
    """The problem in the cluster's memory; its bytes come from the process that owns this worker."""
    return received(pickle.loads(ray.get(reference, timeout=START_SECONDS)))  # noqa: S301


_problems = Recent[Problem](PROBLEMS_KEPT)
_guardian: list[Guardian] = []


def _run_tasks(
    key: str, reference: list[Any], tasks: list[Task], limit: float, residuals: bool
) -> list[tuple[Misfit, float]]:
    """Evaluate ``tasks`` in a Ray worker, each within ``limit`` s; return misfit and duration (s) of each.

    ``key`` names the problem in this worker's cache; ``reference`` is a list with Ray's reference to its bytes, so that
    Ray does not fetch these at every call. ``residuals``: whether misfits contain residuals.
    """
    if not _guardian:
        lower_priority()
        _guardian.append(Guardian())
    # The inner limit gives an error message; the outer one is for a hung worker.
    with _guardian[0].watching(2 * START_SECONDS):
        problem = _problems.use(key, lambda: _fetched(reference[0]))
    done: list[tuple[Misfit, float]] = []
    for task in tasks:
        began = time.monotonic()
        with _guardian[0].watching(limit):
            misfit = task.run(problem, residuals=residuals)
        done.append((misfit, time.monotonic() - began))
    return done
