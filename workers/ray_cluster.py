"""Evaluation on Ray: on this machine, or on a standing cluster of any size.

Arrays that come out of Ray's shared memory are read-only, and compiled kernels take those for another type:
a problem travels as bytes. One call costs milliseconds: units travel in batches, a few per processor.
Ray's default strategy leaves whole generations to the node that had the last one: batches are spread.
Nothing is ever cancelled: in Ray 2.60 a cancellation that meets the end of its task aborts this process.
A worker that hangs ends itself (:mod:`workers.guardian`). A batch whose worker or node is lost is done again from
here and not by Ray, which would say nothing of it.
"""

from __future__ import annotations

import logging
import pickle
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Literal

import numpy.typing as npt

from calibration.evaluator import as_batch, gather, units
from calibration.problem import Evaluation, Misfit, Problem
from workers.errors import EvaluatorClosedError, WorkerLostError
from workers.guardian import Guardian
from workers.ray_connection import Connection, ray, ray_errors
from workers.share import PROBLEMS_KEPT, ProblemMemory, Task, lower_priority
from workers.watch import Expectation, Standing, Tally

LOG = logging.getLogger("wingfit.workers")
BATCHES_PER_WORKER = 3
# Losses in a row after which a batch is given up, as with the pool of processes.
ATTEMPTS = 6
POLL_SECONDS = 0.2
STOP_SECONDS = 30.0
LOOK_SECONDS = 2.0
# A head that has not answered for so long is gone, and so are all workers.
STALE_SECONDS = 20.0

Done = list[tuple[Misfit, float]]
Submit = Callable[[tuple[int, ...], int], "tuple[Any, _Batch]"]


@dataclass(frozen=True)
class _Batch:
    """Tasks that travel together, by their numbers; ``attempt`` counts the workers that were lost with it."""

    numbers: tuple[int, ...]
    attempt: int
    limit: float
    began: float


class RayEvaluator:
    """Spreads units over a Ray cluster; without ``address`` over ``workers`` processes of this machine."""

    kind: Literal["ray"] = "ray"

    def __init__(self, workers: int | None = None, address: str | None = None) -> None:
        self._connection = Connection(workers, address)
        self._condition = threading.Condition()
        self._closed = False
        self._calls = 0
        self._references: OrderedDict[str, Any] = OrderedDict()
        # One at a time from here: Ray would run it again without a word.
        self._run_tasks = ray.remote(num_cpus=1, max_retries=0, scheduling_strategy="SPREAD")(_run_tasks)
        self._expectation, self._tally = Expectation(), Tally()
        self._workers, self._seen = _count_workers(), time.monotonic()
        self._over = threading.Event()
        threading.Thread(target=self._look, name="ray-watch", daemon=True).start()

    @property
    def workers(self) -> int:
        """Processors of the cluster, as of some seconds ago; 0 once its head does not answer."""
        return self._workers if time.monotonic() - self._seen < STALE_SECONDS else 0

    @property
    def standing(self) -> Standing:
        """The processors that there are, and what became of workers."""
        return self._tally.standing(self.workers)

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Misfits of ``values`` [B, F] to every recording of the problem; several threads may call."""
        batch = as_batch(values)
        tasks = [Task.cut(batch, unit) for unit in units(problem, len(batch))]
        with self._call():
            # Dealt out like cards, so that recordings that cost more are spread over all batches.
            count = min(len(tasks), max(1, self.workers) * BATCHES_PER_WORKER)
            hands = [tuple(range(first, len(tasks), count)) for first in range(count)]
            reference = self._put(problem)

            def submit(numbers: tuple[int, ...], attempt: int) -> tuple[Any, _Batch]:
                limit = self._expectation.limit(problem.key, attempt)
                mine = [tasks[number] for number in numbers]
                batch = _Batch(numbers, attempt, limit, time.monotonic())
                return self._run_tasks.remote(problem.key, [reference], mine, limit, residuals), batch

            done = self._collect(problem, dict(submit(hand, 0) for hand in hands), submit)
        return gather(problem, [done[number] for number in range(len(tasks))])

    def close(self) -> None:
        """Leave the cluster, and stop it if it is our own; calls under way raise EvaluatorClosedError."""
        with self._condition:
            if self._closed:
                return
            self._closed = True
            self._over.set()
            # Ray must not be taken away from under a call that still talks to it.
            self._condition.wait_for(lambda: self._calls == 0, STOP_SECONDS)
            self._references.clear()
        self._connection.close()

    @contextmanager
    def _call(self) -> Iterator[None]:
        with self._condition:
            if self._closed:
                raise EvaluatorClosedError(self.kind)
            self._calls += 1
        try:
            yield
        finally:
            with self._condition:
                self._calls -= 1
                self._condition.notify_all()

    def _look(self) -> None:
        """Count the processors of nodes that live, again and again; a head that is gone holds up this thread alone."""
        while not self._over.wait(LOOK_SECONDS):
            # Without a head Ray raises what it happens to; the count is old then, and so counts as none.
            with suppress(Exception), self._call():
                count = _count_workers()
                if not count and self._workers:
                    LOG.warning("the Ray cluster has no worker any more; evaluations wait until one joins")
                self._workers, self._seen = count, time.monotonic()

    def _put(self, problem: Problem) -> Any:
        """Return the reference to the problem in the cluster's memory, where it is put once."""
        with self._condition:
            if problem.key not in self._references:
                self._references[problem.key] = ray.put(pickle.dumps(problem, pickle.HIGHEST_PROTOCOL))
                while len(self._references) > PROBLEMS_KEPT:
                    self._references.popitem(last=False)
            self._references.move_to_end(problem.key)
            return self._references[problem.key]

    def _collect(self, problem: Problem, pending: dict[Any, _Batch], submit: Submit) -> dict[int, Misfit]:
        """What became of all tasks, by their numbers; batches whose worker was lost are submitted again."""
        done: dict[int, Misfit] = {}
        while pending:
            if self._closed:
                raise EvaluatorClosedError(self.kind)
            ready, _ = ray.wait(list(pending), num_returns=len(pending), timeout=POLL_SECONDS)
            for reference in ready:
                batch = pending.pop(reference)
                try:
                    answers: Done = ray.get(reference)
                except ray_errors.RayTaskError as error:
                    raise (error.cause if isinstance(error.cause, Exception) else RuntimeError(str(error))) from error
                except ray_errors.RayError as error:
                    self._lost(problem, batch, error)
                    again, later = submit(batch.numbers, batch.attempt + 1)
                    pending[again] = later
                    continue
                for number, (misfit, seconds) in zip(batch.numbers, answers, strict=True):
                    done[number] = misfit
                    self._expectation.done(problem.key, seconds)
        return done

    def _lost(self, problem: Problem, batch: _Batch, error: Exception) -> None:
        """Count and log the loss of a worker; WorkerLostError where it was one too many."""
        if self._closed:
            raise EvaluatorClosedError(self.kind) from error
        seconds = time.monotonic() - batch.began
        hung = isinstance(error, ray_errors.WorkerCrashedError) and seconds >= batch.limit
        self._tally.count(died=not hung, hung=hung, restarts=1)
        what = f"{len(batch.numbers)} units of {problem.key[:8]} over {len(problem.recordings)} recordings"
        reason = f"took more than {batch.limit:.0f} s for one" if hung else f"{type(error).__name__}: {error}"
        LOG.warning("a Ray worker was lost after %.1f s with %s (%s); they are done again", seconds, what, reason)
        if batch.attempt + 1 >= ATTEMPTS:
            raise WorkerLostError(
                f"{ATTEMPTS} Ray workers were lost one after the other with the same {what}, the last because: "
                f"{reason}; if memory ran out, use fewer workers than {self.workers}"
            ) from error


def _count_workers() -> int:
    return int(ray.cluster_resources().get("CPU", 0))


_problems = ProblemMemory()
_guardian: list[Guardian] = []


def _run_tasks(key: str, reference: list[Any], tasks: list[Task], limit: float, residuals: bool) -> Done:
    """Do some tasks in a Ray worker, each within ``limit`` s; with the seconds that each took.

    As an item of a list, the reference is not fetched at every call.
    """
    if not _guardian:
        lower_priority()
        _guardian.append(Guardian())
    problem = _problems.get(key, lambda: ray.get(reference[0]))
    done: Done = []
    for task in tasks:
        began = time.monotonic()
        with _guardian[0].watching(limit):
            misfit = task.run(problem, residuals=residuals)
        done.append((misfit, time.monotonic() - began))
    return done
