"""Evaluation on Ray: on this machine, or on a standing cluster of any size.

Arrays that come out of Ray's shared memory are read-only, and compiled kernels take those for another type:
a problem travels as bytes. One call costs milliseconds: units travel in batches, a few per processor.
Ray's default strategy leaves whole generations to the node that had the last one: batches are spread.
Nothing is ever cancelled: in Ray 2.60 a cancellation that meets the end of its task aborts this process.
"""

from __future__ import annotations

import logging
import pickle
import threading
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Literal

import numpy.typing as npt

from calibration.evaluator import as_batch, gather, units
from calibration.problem import Evaluation, Misfit, Problem
from workers.errors import EvaluatorClosedError, WorkerLostError
from workers.ray_connection import Connection, ray, ray_errors
from workers.share import PROBLEMS_KEPT, ProblemMemory, Task, lower_priority

LOG = logging.getLogger("wingfit.workers")
BATCHES_PER_WORKER = 3
RETRIES = 5
POLL_SECONDS = 0.2
STOP_SECONDS = 30.0


class RayEvaluator:
    """Spreads units over a Ray cluster; without ``address`` over ``workers`` processes of this machine."""

    kind: Literal["ray"] = "ray"

    def __init__(self, workers: int | None = None, address: str | None = None) -> None:
        self._connection = Connection(workers, address)
        self._condition = threading.Condition()
        self._closed = False
        self._calls = 0
        self._references: OrderedDict[str, Any] = OrderedDict()
        self._run_tasks = ray.remote(num_cpus=1, max_retries=RETRIES, scheduling_strategy="SPREAD")(_run_tasks)
        self._workers = self._count_workers()

    @property
    def workers(self) -> int:
        """Processors of the cluster, as of the last evaluation."""
        return self._workers

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Misfits of ``values`` [B, F] to every recording of the problem; several threads may call."""
        batch = as_batch(values)
        tasks = [Task.cut(batch, unit) for unit in units(problem, len(batch))]
        with self._call():
            self._workers = self._count_workers()
            # Dealt out like cards, so that recordings that cost more are spread over all batches.
            count = min(len(tasks), max(1, self._workers) * BATCHES_PER_WORKER)
            hands = [range(first, len(tasks), count) for first in range(count)]
            reference = self._put(problem)
            pending = [
                self._run_tasks.remote(problem.key, [reference], [tasks[i] for i in hand], residuals) for hand in hands
            ]
            answers = self._wait(pending)
        done: dict[int, Misfit] = {}
        for hand, parts in zip(hands, answers, strict=True):
            done.update(zip(hand, parts, strict=True))
        return gather(problem, [done[i] for i in range(len(tasks))])

    def close(self) -> None:
        """Leave the cluster, and stop it if it is our own; calls under way raise EvaluatorClosedError."""
        with self._condition:
            if self._closed:
                return
            self._closed = True
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

    def _count_workers(self) -> int:
        count = int(ray.cluster_resources().get("CPU", 0))
        if not count:
            LOG.warning("the Ray cluster has no worker; evaluations wait until one joins")
        return count

    def _put(self, problem: Problem) -> Any:
        """Return the reference to the problem in the cluster's memory, where it is put once."""
        with self._condition:
            if problem.key not in self._references:
                self._references[problem.key] = ray.put(pickle.dumps(problem, pickle.HIGHEST_PROTOCOL))
                while len(self._references) > PROBLEMS_KEPT:
                    self._references.popitem(last=False)
            self._references.move_to_end(problem.key)
            return self._references[problem.key]

    def _wait(self, pending: Sequence[Any]) -> list[list[Misfit]]:
        try:
            while not self._closed:
                with suppress(ray_errors.GetTimeoutError):
                    answers: list[list[Misfit]] = ray.get(pending, timeout=POLL_SECONDS)
                    return answers
            raise EvaluatorClosedError(self.kind)
        except ray_errors.RayTaskError as error:
            raise (error.cause if isinstance(error.cause, Exception) else RuntimeError(str(error))) from error
        except ray_errors.RayError as error:
            raise WorkerLostError(
                f"Ray gave up after {RETRIES} retries: {type(error).__name__}: {error}; if memory ran out, "
                f"use fewer workers than {self._workers}"
            ) from error


_problems = ProblemMemory()
_settled = threading.Event()


def _run_tasks(key: str, reference: list[Any], tasks: list[Task], residuals: bool) -> list[Misfit]:
    """Do some tasks in a Ray worker; as an item of a list, the reference is not fetched at every call."""
    if not _settled.is_set():
        lower_priority()
        _settled.set()
    problem = _problems.get(key, lambda: ray.get(reference[0]))
    return [task.run(problem, residuals=residuals) for task in tasks]
