"""Runs calibrations: a few at a time, one thread each, every generation stored before the next begins.

What a run may do next is decided by :mod:`workers.jobs`; here its instructions are carried out. A run is
RUNNING only while its thread lives, so after any end of the process the database says what is left to do.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from typing import Any

from calibration.evaluator import Evaluator
from calibration.force_result import ForceResult
from calibration.search import Generation
from service import force_views, store, views
from service.changes import Changes
from service.database import Database, DatabaseClosedError
from service.datasets import Datasets
from service.engine import Engine
from service.problems import conflict
from service.remedies import with_remedy
from service.tables import CheckpointRow, GenerationRow, RunRow
from service.units import finite
from workers import jobs
from workers.jobs import Instruction

LOG = logging.getLogger("wingfit.runs")
LONGEST_ERROR = 1000
# Calibrations yield to the API when both want a processor.
NICENESS = 10


class Runner:
    """Owns the threads that compute runs."""

    def __init__(self, database: Database, engine: Engine, datasets: Datasets, changes: Changes, max_runs: int) -> None:
        self._database, self._engine, self._datasets, self._changes = database, engine, datasets, changes
        self._max_runs = max_runs
        self._lock = threading.RLock()
        self._waiting: deque[str] = deque()
        self._threads: dict[str, threading.Thread] = {}
        self._evaluator: Evaluator | None = None
        self._stopping = False

    # -- from outside ----------------------------------------------------------------------------------------

    def recover(self) -> None:
        """Take up what an earlier process left: runs under way first, then those that waited."""
        with self._lock:
            with self._database.write() as session:
                running = store.runs_in(session, jobs.State.RUNNING)
                waiting = store.runs_in(session, jobs.State.QUEUED)
                todo = [(row.id, _step(row, jobs.Restart())) for row in (*running, *waiting)]
            for run_id, instructions in todo:
                self._obey(run_id, instructions)

    def attach(self, evaluator: Evaluator) -> None:
        """Begin to compute with ``evaluator``."""
        with self._lock:
            self._evaluator = evaluator
        self._dispatch()

    def enqueue(self, run_id: str) -> None:
        """A new run was stored as QUEUED."""
        self._obey(run_id, (Instruction.ENQUEUE, Instruction.PUBLISH))

    def control(self, run_id: str, event: jobs.Event) -> RunRow:
        """Apply a user's event; a 409 with the state when the run does not admit it."""
        with self._lock:
            with self._database.write() as session:
                row = store.run(session, run_id)
                try:
                    instructions = _step(row, event)
                except jobs.IllegalTransition as error:
                    raise conflict(f"run {run_id}: {error}", state=row.state) from None
            self._obey(run_id, (*instructions, Instruction.PUBLISH))
        return row

    def begin_stop(self) -> None:
        """Start nothing more, and let no failure from now on count as the run's. Safe in a signal handler."""
        self._stopping = True

    def stop(self, timeout: float) -> bool:
        """Wait for the generations under way, at most ``timeout`` s; whether all threads ended."""
        self.begin_stop()
        deadline = time.monotonic() + timeout
        with self._lock:
            threads = list(self._threads.values())
        for thread in threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in threads)

    # -- the waiting line ------------------------------------------------------------------------------------

    def _obey(self, run_id: str, instructions: tuple[Instruction, ...]) -> None:
        with self._lock:
            if Instruction.ENQUEUE in instructions and run_id not in self._waiting:
                self._waiting.append(run_id)
            if Instruction.DEQUEUE in instructions and run_id in self._waiting:
                self._waiting.remove(run_id)
        if Instruction.PUBLISH in instructions:
            self._changes.publish(run_id)
        self._dispatch()

    def _dispatch(self) -> None:
        with self._lock:
            while self._evaluator and not self._stopping and len(self._threads) < self._max_runs:
                # A run that was paused and resumed waits until its earlier thread has ended.
                run_id = next((waiting for waiting in self._waiting if waiting not in self._threads), None)
                if run_id is None:
                    return
                self._waiting.remove(run_id)
                thread = threading.Thread(
                    target=self._work, args=(run_id, self._evaluator), name=f"run-{run_id}", daemon=True
                )
                self._threads[run_id] = thread
                thread.start()

    # -- in the run's thread ---------------------------------------------------------------------------------

    def _work(self, run_id: str, evaluator: Evaluator) -> None:
        lower_priority()
        try:
            self._calibrate(run_id, evaluator)
        except (DatabaseClosedError, jobs.IllegalTransition) as error:
            LOG.info("run %s: left as stored (%s)", run_id, error)
        except Exception as error:
            self._fail(run_id, error)
        finally:
            with self._lock:
                self._threads.pop(run_id, None)
            self._dispatch()

    def _calibrate(self, run_id: str, evaluator: Evaluator) -> None:
        row = self._advance(run_id, jobs.Start())
        spec, dataset = store.spec(row), self._datasets.get(row.dataset_id)
        with self._database.read() as session:
            checkpoint = store.checkpoint(session, run_id)
            points = [(g.elapsed_seconds, g.progress) for g in store.history(session, run_id, 0)]
        earlier, began = row.elapsed_seconds, time.monotonic()
        LOG.info("run %s: starts after generation %d", run_id, row.generations)
        for generation in self._engine.calibrate(spec, dataset, evaluator, checkpoint):
            checkpoint = generation.checkpoint
            points.append((earlier + time.monotonic() - began, generation.progress))
            goes_on = self._store(run_id, generation, points)
            if self._stopping or not goes_on:
                return
        if checkpoint is None:
            raise ValueError("the search ended without a generation")
        judged = self._engine.summarise(spec, dataset, evaluator, checkpoint)
        if isinstance(judged, ForceResult):
            outcome = force_views.result(judged, spec, dataset).model_dump(mode="json")
        else:
            outcome = views.result(judged).model_dump(mode="json")
        self._advance(run_id, jobs.Finish(), result=outcome)

    def _store(self, run_id: str, generation: Generation, points: list[tuple[float, float]]) -> bool:
        """One generation with its checkpoint and genome, in one transaction; whether the run goes on."""
        eta = jobs.eta_seconds(points)
        with self._database.write() as session:
            row = store.run(session, run_id)
            instructions = _step(row, jobs.Generation(generation.progress))
            row.stage, row.genome = generation.stage, generation.genome
            misfit = views.misfit(row.kind, generation.distance)
            row.best_mm, row.best_mn = misfit["best_mm"], misfit["best_mn"]
            row.evaluations = generation.evaluations
            row.elapsed_seconds = points[-1][0]
            row.eta_seconds = eta if row.state == jobs.State.RUNNING else None
            session.add(_generation_row(row, generation, eta))
            session.merge(CheckpointRow(run_id=run_id, body=generation.checkpoint))
        self._obey(run_id, (*instructions, Instruction.PUBLISH))
        return Instruction.STOP not in instructions

    def _advance(self, run_id: str, event: jobs.Event, result: dict[str, Any] | None = None) -> RunRow:
        with self._database.write() as session:
            row = store.run(session, run_id)
            instructions = _step(row, event)
            if row.state == jobs.State.SUCCEEDED and result is not None:
                row.result = result
                # while it runs, the best of the present stage; in the end, over all that was fitted
                row.best_mm, row.best_mn = result.get("after_mm"), result.get("after_mn")
        self._obey(run_id, instructions)
        return row

    def _fail(self, run_id: str, error: Exception) -> None:
        if self._stopping:
            LOG.info("run %s: interrupted by the stop of the service (%s)", run_id, error)
            return
        LOG.error("run %s failed", run_id, exc_info=error)
        try:
            self._advance(run_id, jobs.Fail(_failure(error)))
        except Exception as late:
            # A full disk, say: the run stays as stored and goes on at the next start of the service.
            LOG.error("run %s: failure not stored (%s)", run_id, late)


def message(error: Exception) -> str:
    """``error`` for the user: what the domain says as it stands, a surprise with its kind; no stack trace."""
    text = with_remedy(str(error)) if _told(error) else f"{type(error).__name__}: {error}"
    return text[:LONGEST_ERROR]


def _told(error: Exception) -> bool:
    """Whether ``error`` is the domain's own word to the user."""
    return isinstance(error, ValueError) and bool(str(error))


def _failure(error: Exception) -> str:
    """Why a run failed; a surprise is the server's fault, and said to be."""
    if _told(error):
        return message(error)
    return f"the server made a mistake ({message(error)}); the run's data are kept; please report it"


def lower_priority() -> None:
    """Lower the priority of the calling thread and of the processes it starts."""
    try:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
    except OSError:
        LOG.debug("cannot lower the priority of a run")


def _step(row: RunRow, event: jobs.Event) -> tuple[Instruction, ...]:
    job, instructions = jobs.step(store.job(row), event)
    store.put_job(row, job)
    return instructions


def _generation_row(row: RunRow, generation: Generation, eta: float | None) -> GenerationRow:
    return GenerationRow(
        run_id=row.id,
        sequence=row.generations,
        stage=generation.stage,
        generation=generation.index,
        best=finite(generation.best),
        mean=finite(generation.mean),
        diversity=finite(generation.diversity),
        **views.misfit(row.kind, generation.distance),
        evaluations=generation.evaluations,
        failed=generation.failed,
        reasons=list(generation.reasons),
        elapsed_seconds=row.elapsed_seconds,
        progress=row.progress,
        eta_seconds=eta,
    )
