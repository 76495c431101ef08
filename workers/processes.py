"""Evaluation in worker processes of this machine.

One thread looks after one process over one pipe. When a process dies, its thread alone notices, starts
another and repeats the one unit that was lost; everything else goes on.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import queue
import signal
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, Literal

import numpy.typing as npt

from calibration.evaluator import as_batch, gather, units
from calibration.problem import Evaluation, Misfit, Problem
from workers.errors import EvaluatorClosedError, WorkerLostError
from workers.share import ProblemMemory, Task, child_environment, lower_priority

ATTEMPTS = 3
Answer = tuple[Literal["done", "raised", "need problem"], Any]


class ProcessPoolEvaluator:
    """Spreads units over ``workers`` processes, by default one per processor."""

    kind: Literal["processes"] = "processes"

    def __init__(self, workers: int | None = None) -> None:
        self._lock = threading.Lock()
        self._closed = False
        self._pool = [_Worker() for _ in range(workers or os.cpu_count() or 1)]
        self._idle: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
        for worker in self._pool:
            worker.start()
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(len(self._pool), thread_name_prefix="evaluator")

    @property
    def workers(self) -> int:
        """Number of processes."""
        return len(self._pool)

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Misfits of ``values`` [B, F] to every recording of the problem; several threads may call."""
        batch = as_batch(values)
        tasks = [Task.cut(batch, unit) for unit in units(problem, len(batch))]
        futures: list[Future[Misfit]] = []
        try:
            with self._lock:
                self._check_open()
                futures += [self._threads.submit(self._run, problem, task, residuals) for task in tasks]
            return gather(problem, [future.result() for future in futures])
        except CancelledError:
            raise EvaluatorClosedError(self.kind) from None
        finally:
            for future in futures:
                future.cancel()

    def close(self) -> None:
        """Stop the processes; calls under way raise :class:`EvaluatorClosedError`."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            for worker in self._pool:
                worker.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._pool:
            worker.release()

    def _check_open(self) -> None:
        if self._closed:
            raise EvaluatorClosedError(self.kind)

    def _run(self, problem: Problem, task: Task, residuals: bool) -> Misfit:
        worker = self._idle.get()
        try:
            for _ in range(ATTEMPTS):
                try:
                    return worker.run(problem, task, residuals)
                except _Died:
                    self._restart(worker)
        finally:
            self._idle.put(worker)
        name = problem.recordings[task.unit.recording].name
        raise WorkerLostError(
            f"{ATTEMPTS} worker processes died one after the other on the same {len(task.values)} "
            f"individuals against recording {name!r} (the last with {worker.last_exit}); if memory ran out, "
            f"use fewer workers than {self.workers}"
        )

    def _restart(self, worker: _Worker) -> None:
        with self._lock:
            self._check_open()
            worker.release()
            worker.start()


class _Died(Exception):  # noqa: N818  internal
    """The process at the other end of the pipe is gone."""


class _Worker:
    """Our end of one process. Used by one thread at a time."""

    def __init__(self) -> None:
        self.last_exit = "exit code unknown"
        self._process: SpawnProcess | None = None
        self._connection: Connection | None = None

    def start(self) -> None:
        """Start a process."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,), name="wingfit-worker", daemon=True)
        with child_environment():
            process.start()
        # The process has its own copy now; ours must go, or its death would not end the pipe.
        theirs.close()
        self._process, self._connection = process, ours

    def run(self, problem: Problem, task: Task, residuals: bool) -> Misfit:
        """Have ``task`` done; _Died when the process is dead, or what the model raised."""
        kind, content = self._ask((problem.key, task, residuals))
        if kind == "need problem":
            kind, content = self._ask(pickle.dumps(problem, pickle.HIGHEST_PROTOCOL))
        if kind == "raised":
            raise content
        assert isinstance(content, Misfit)  # noqa: S101
        return content

    def _ask(self, message: object) -> Answer:
        if self._connection is None:
            raise _Died
        try:
            self._connection.send(message)
            answer: Answer = self._connection.recv()
        except (EOFError, OSError) as error:
            raise _Died from error
        return answer

    def kill(self) -> None:
        """End the process at once; a thread that waits for it gets _Died."""
        if self._process:
            self._process.kill()

    def release(self) -> None:
        """Let go of a process that is dead or dying."""
        if self._process is None or self._connection is None:
            return
        self._process.kill()
        self._process.join()
        self.last_exit = f"exit code {self._process.exitcode}"
        self._process.close()
        self._connection.close()
        self._process = self._connection = None


def _serve(connection: Connection) -> None:
    """Run tasks until the owner goes away: the main loop of a worker process."""
    # Ctrl-C in a terminal reaches every process of the group; the owner decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lower_priority()
    problems = ProblemMemory()

    def fetch() -> bytes:
        connection.send(("need problem", None))
        content: bytes = connection.recv()
        return content

    while True:
        try:
            key, task, residuals = connection.recv()
        except (EOFError, OSError):
            return
        connection.send(_attempt(problems, fetch, key, task, residuals))


def _attempt(problems: ProblemMemory, fetch: Callable[[], bytes], key: str, task: Task, residuals: bool) -> Answer:
    try:
        return "done", task.run(problems.get(key, fetch), residuals=residuals)
    except Exception as error:
        error.add_note(f"raised in worker process {os.getpid()}:\n{traceback.format_exc()}")
        return "raised", _portable(error)


def _portable(error: Exception) -> Exception:
    """``error``, or a stand-in when it cannot cross a pipe."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  our own bytes
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}\n{traceback.format_exc()}")
    return error
