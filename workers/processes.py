"""Evaluates individuals in worker processes of this machine.

A unit of work is some individuals against one recording. A thread of this process sends a unit to a worker process over
a pipe, and waits for the answer. If the worker process dies, the thread starts another and repeats the lost unit; the
other worker processes are not affected. One more thread kills worker processes that exceed the time limit of
:class:`wingfit.workers.watch.Expectation` (also suspended ones), so that they are replaced.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import pickle
import queue
import signal
import threading
import time
import traceback
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for_futures
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for
from multiprocessing.context import SpawnProcess
from typing import Any, Literal

from wingfit.calibration.problem import Misfit, Problem
from wingfit.workers.errors import EvaluationInterruptedError, EvaluatorClosedError, WorkerLostError
from wingfit.workers.recent import Recent
from wingfit.workers.running_evaluator import Interrupted, RunningEvaluator
from wingfit.workers.share import PROBLEMS_KEPT, Task, child_environment, lower_priority, received
from wingfit.workers.watch import ATTEMPTS, START_SECONDS, STARTS, Expectation, Standing, Tally

COLLECTED_SECONDS = 1.0  # after which an exit code that another thread collects is not waited for
LOG = logging.getLogger("wingfit.workers")
LOOK_SECONDS = 0.5
Answer = tuple[Literal["need problem", "begun", "done", "raised"], Any]


class ProcessPoolEvaluator(RunningEvaluator):
    """Evaluates the units of work of a batch in ``workers`` processes (default: one per processor) at the same time."""

    kind: Literal["processes"] = "processes"

    def __init__(self, workers: int | None = None) -> None:
        self._lock = threading.Lock()
        self._expectation, self._tally = Expectation(), Tally()
        self._pool = [_Worker() for _ in range(workers or os.cpu_count() or 1)]
        self._idle: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
        for worker in self._pool:
            worker.start()
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(len(self._pool), thread_name_prefix="evaluator")
        self._over = threading.Event()
        threading.Thread(target=self._watch, name="evaluator-watch", daemon=True).start()

    @property
    def workers(self) -> int:
        """Number of worker processes."""
        return len(self._pool)

    @property
    def standing(self) -> Standing:
        """Number of living worker processes, and counts of lost ones."""
        return self._tally.standing(sum(worker.alive for worker in self._pool))

    def _misfits(self, problem: Problem, tasks: list[Task], residuals: bool, interrupted: Interrupted) -> list[Misfit]:
        futures: list[Future[Misfit]] = []
        try:
            with self._lock:
                self._check()
                futures += [self._threads.submit(self._run, problem, task, residuals) for task in tasks]
            return [_result(future, interrupted) for future in futures]
        except CancelledError:
            raise EvaluatorClosedError(self.kind) from None
        finally:
            for future in futures:
                future.cancel()

    def close(self) -> None:
        """Stop the worker processes; calls in progress raise :class:`EvaluatorClosedError`."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self._over.set()
            for worker in self._pool:
                worker.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._pool:
            worker.release()

    def _watch(self) -> None:
        while not self._over.wait(LOOK_SECONDS):
            for worker in self._pool:
                worker.kill_if_overdue()

    def _run(self, problem: Problem, task: Task, residuals: bool) -> Misfit:
        worker, blamed, died = self._idle.get(), 0, 0
        what = f"{len(task.values)} individuals against recording {problem.recordings[task.unit.recording].name!r}"
        try:
            while blamed < ATTEMPTS and died < STARTS:
                limit = self._expectation.limit(problem.key, blamed)
                try:
                    misfit, seconds = worker.run(problem, task, residuals, limit)
                except _Died as death:
                    # A process that dies during its start has not received the unit yet.
                    blamed, died = blamed + death.begun, died + 1
                    self._restart(worker, death, what, limit)
                else:
                    self._expectation.done(problem.key, seconds)
                    return misfit
        finally:
            self._idle.put(worker)
        where = "on the same unit" if blamed == ATTEMPTS else "before starting the unit"
        raise WorkerLostError(
            f"{died} worker processes died or hung one after the other {where}, {what} (the last with "
            f"{worker.last_exit}); if memory ran out, use fewer workers than {self.workers}"
        )

    def _restart(self, worker: _Worker, death: _Died, what: str, limit: float) -> None:
        with self._lock:
            self._check()
            pid = worker.pid
            worker.release()
            worker.start()
        self._tally.replaced("hung" if death.hung else "died")
        if death.hung and death.begun:
            LOG.warning("worker process %s hung: %s took more than %.0f s; it was replaced", pid, what, limit)
        elif death.hung:
            LOG.warning("worker process %s hung before starting %s; it was replaced", pid, what)
        else:
            LOG.warning("worker process %s died (%s) with %s; it was replaced", pid, worker.last_exit, what)


def _result(future: Future[Misfit], interrupted: Interrupted) -> Misfit:
    while not interrupted():
        if wait_for_futures([future], LOOK_SECONDS).done:
            return future.result()
    raise EvaluationInterruptedError


class _Died(Exception):  # noqa: N818  internal
    """A worker process has ended before it returned a result.

    ``begun``: whether it had begun the unit of work; ``hung``: whether it was killed for exceeding the time limit.
    """

    def __init__(self, *, begun: bool, hung: bool = False) -> None:
        super().__init__()
        self.begun, self.hung = begun, hung


class _Worker:
    """One worker process and the pipe to it; used by one thread at a time, and by the thread that enforces time limits.

    The process may be replaced by another; ``last_exit`` describes the exit of the previous one.
    """

    def __init__(self) -> None:
        self.last_exit = "exit code unknown"
        # Deadline of the current unit; under the lock, so that no process is killed for a unit that is done.
        self._deadline: float | None = None
        self._hung = False
        # Whether the process has finished a unit; before that it gets more time.
        self._proven = False
        self._watching = threading.Lock()
        self._process: SpawnProcess | None = None
        self._connection: Connection | None = None

    def start(self) -> None:
        """Start a worker process with a pipe to it."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,), name="wingfit-worker", daemon=True)
        with child_environment():
            process.start()
        # The process has its own copy; ours must be closed, or its death would not close the pipe.
        theirs.close()
        self._process, self._connection = process, ours
        self._proven = self._hung = False

    @property
    def pid(self) -> int | None:
        """Id of the process, None if there is none."""
        return self._process.pid if self._process else None

    @property
    def alive(self) -> bool:
        """Whether the process lives."""
        process = self._process
        try:
            return process is not None and not wait_for([process.sentinel], 0)
        except ValueError:  # closed in the meantime
            return False

    def run(self, problem: Problem, task: Task, residuals: bool, limit: float) -> tuple[Misfit, float]:
        """Evaluate ``task`` in the process, and return the misfit and the duration (s).

        ``residuals``: whether the misfit contains residuals. Raises _Died if the process dies or is killed at the time
        ``limit`` (s), and exceptions of the model as they are.
        """
        self._expect(limit if self._proven else max(limit, START_SECONDS))
        try:
            return self._done(problem, task, residuals, limit)
        finally:
            self._expect(None)

    def kill_if_overdue(self) -> None:
        """Kill the process if its deadline has passed; then :meth:`run`, which waits for it, raises _Died."""
        with self._watching:
            if self._deadline is not None and time.monotonic() > self._deadline:
                self._deadline, self._hung = None, True
                self.kill()

    def _expect(self, seconds: float | None) -> None:
        """Set the deadline of the process to ``seconds`` from now; None removes the deadline."""
        with self._watching:
            self._deadline = None if seconds is None else time.monotonic() + seconds

    def _done(self, problem: Problem, task: Task, residuals: bool, limit: float) -> tuple[Misfit, float]:
        if self._connection is None:
            raise _Died(begun=False)
        kind: str = "not yet"
        try:
            self._connection.send((problem.key, task, residuals))
            while kind not in ("done", "raised"):
                answer: Answer = self._connection.recv()
                kind, content = answer
                if kind == "need problem":
                    self._connection.send(problem)
                if kind == "begun":
                    self._expect(limit)
        except (EOFError, OSError) as error:
            raise _Died(begun=kind == "begun", hung=self._hung) from error
        self._proven = True
        if kind == "raised":
            raise content
        misfit, seconds = content
        assert isinstance(misfit, Misfit)  # noqa: S101
        return misfit, float(seconds)

    def kill(self) -> None:
        """Kill the process; then :meth:`run`, if it waits for the process, raises _Died."""
        if self._process:
            self._process.kill()

    def release(self) -> None:
        """Kill the process if it still lives, wait for its end, and close the pipe."""
        if self._process is None or self._connection is None:
            return
        self._process.kill()
        self._process.join()
        # Another thread (multiprocessing.active_children) may just be collecting the exit code, and then join returns.
        patience = time.monotonic() + COLLECTED_SECONDS
        while self._process.exitcode is None and time.monotonic() < patience:
            time.sleep(0.001)
        self.last_exit = f"exit code {self._process.exitcode}"
        if self._process.exitcode is not None:
            self._process.close()
        self._connection.close()
        self._process = self._connection = None


def _serve(connection: Connection) -> None:
    """Run in a worker process: evaluate the tasks that arrive over ``connection`` until it is closed."""
    # Ctrl-C in a terminal reaches every process of the group; only the owner handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lower_priority()
    problems = Recent[Problem](PROBLEMS_KEPT)
    while True:
        try:
            key, task, residuals = connection.recv()
            connection.send(_attempt(connection, problems, key, task, residuals))
        except (EOFError, OSError):
            return


def _attempt(connection: Connection, problems: Recent[Problem], key: str, task: Task, residuals: bool) -> Answer:
    def fetch() -> Problem:
        connection.send(("need problem", None))
        return received(connection.recv())

    try:
        problem = problems.use(key, fetch)
        connection.send(("begun", None))
        began = time.monotonic()
        return "done", (task.run(problem, residuals=residuals), time.monotonic() - began)
    except Exception as error:
        error.add_note(f"raised in worker process {os.getpid()}:\n{traceback.format_exc()}")
        return "raised", _portable(error)


def _portable(error: Exception) -> Exception:
    """Return ``error``, or a RuntimeError with the same text if ``error`` cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  our own bytes
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}\n{traceback.format_exc()}")
    return error
