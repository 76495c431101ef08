"""Computes jobs (calibrations, diagnoses): a few at a time, one thread each, every step stored before the next begins.

What a job may do next is decided by :mod:`wingfit.workers.jobs`; here its instructions are carried out. How a kind of
job is computed is its :class:`wingfit.service.jobs.job_kind.Work`. A job is RUNNING only while its thread lives, so
after any end of the process the database says what is left to do.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple, TypeVar

from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from wingfit.service.http.problems import conflict
from wingfit.service.jobs.interruptible import InterruptibleEvaluator
from wingfit.service.jobs.job_kind import InterruptedStepError, Points, Step, Work
from wingfit.service.jobs.wakeups import Changes
from wingfit.service.runs.simulation_hints import with_remedy
from wingfit.service.storage import store
from wingfit.service.storage.database import Database, DatabaseClosedError, is_full
from wingfit.service.storage.tables import JobRow
from wingfit.workers import RunningEvaluator, jobs
from wingfit.workers.jobs import Instruction

LOG = logging.getLogger("wingfit.runs")
LONGEST_ERROR = 1000
# Calibrations yield to the API when both want a processor.
NICENESS = 10
# Between attempts to write on a full disk: the first, the longest.
ROOM_SECONDS = (0.5, 15.0)

Written = TypeVar("Written")


class Known(NamedTuple):
    """A job, its kind, and whose it is."""

    work: Work
    id: str
    owner: str | None

    def __str__(self) -> str:
        return f"{self.work.what} {self.id}"


class Pace(NamedTuple):
    """How jobs get on: seconds since the last progress of the slowest that runs, and that the oldest has waited."""

    stalled_s: float
    waited_s: float


class Runner:
    """Owns the threads that compute jobs."""

    def __init__(
        self,
        database: Database,
        changes: Changes,
        kinds: Sequence[Work],
        at_once: int,
        of_one: int | None = None,
        most_starts: int = jobs.MOST_STARTS,
    ) -> None:
        """``at_once`` jobs are computed at a time, of them ``of_one`` of one owner.

        A job during which the server ended ``most_starts`` times without progress is given up.
        """
        self._database, self._changes, self._kinds = database, changes, kinds
        self._at_once, self._of_one, self._most_starts = at_once, of_one or at_once, most_starts
        self._lock = threading.RLock()
        self._waiting: deque[Known] = deque()
        self._waits_since: dict[Known, float] = {}
        self._progressed: dict[Known, float] = {}
        self._cancelled: set[Known] = set()
        # Jobs that had better be alone, lest others are given up for what one of them does.
        self._suspects: set[Known] = set()
        self._threads: dict[Known, threading.Thread] = {}
        self._evaluator: RunningEvaluator | None = None
        self._stopping = False

    # -- from outside ----------------------------------------------------------------------------------------

    def recover(self) -> None:
        """Take up what an earlier process left: jobs under way first, then those that waited."""
        with self._lock:
            with self._database.write() as session:
                left = [
                    (row, Known(work, row.id, row.owner))
                    for state in (jobs.State.RUNNING, jobs.State.QUEUED)
                    for row, work in self._unfinished(session, state)
                ]
                todo = [(job, _step(row, jobs.Restart(self._most_starts))) for row, job in left]
                self._suspects = {job for row, job in left if self._is_suspect(row)}
            for job, instructions in todo:
                self._obey(job, instructions)

    def attach(self, evaluator: RunningEvaluator) -> None:
        """Begin to compute with ``evaluator``."""
        with self._lock:
            self._evaluator = evaluator
        self._dispatch()

    def enqueue(self, work: Work, job_id: str, owner: str | None) -> None:
        """A new job was stored as QUEUED."""
        self._obey(Known(work, job_id, owner), (Instruction.ENQUEUE, Instruction.PUBLISH))

    def control(self, work: Work, job_id: str, event: jobs.Event) -> JobRow:
        """Apply a user's event; a 409 with the state when the job does not admit it."""
        with self._lock:
            with self._database.write() as session:
                row = store.one(session, work.table, job_id)
                job = Known(work, job_id, row.owner)
                if row.state == jobs.State.RUNNING and job not in self._threads and not self._stopping:
                    _step(row, jobs.Restart(self._most_starts))  # its end could not be stored
                try:
                    instructions = _step(row, event)
                except jobs.IllegalTransition as error:
                    raise conflict(f"{job}: {error}", state=row.state) from None
            if row.wish == jobs.Wish.CANCEL:
                self._cancelled.add(job)
            if Instruction.ENQUEUE in instructions and self._is_suspect(row):
                self._suspects.add(job)
            self._obey(job, (*instructions, Instruction.PUBLISH))
        return row

    def begin_stop(self) -> None:
        """Start nothing more, and let no failure from now on count as the job's. Safe in a signal handler."""
        self._stopping = True

    def stop(self, timeout: float) -> bool:
        """Wait for the steps under way, at most ``timeout`` s; whether all threads ended."""
        self.begin_stop()
        deadline = time.monotonic() + timeout
        self._leave()
        with self._lock:
            threads = list(self._threads.values())
        for thread in threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in threads)

    def pace(self) -> Pace:
        """How jobs get on now."""
        with self._lock:
            now = time.monotonic()
            return Pace(
                max((now - since for since in self._progressed.values()), default=0.0),
                max((now - since for since in self._waits_since.values()), default=0.0),
            )

    def _leave(self) -> None:
        """A stop in good order says nothing against the jobs that ran."""
        try:
            with self._database.write() as session:
                for row, _ in self._unfinished(session, jobs.State.RUNNING):
                    _step(row, jobs.Leave())
        except (DatabaseClosedError, OperationalError) as error:
            LOG.warning("the stop is not stored (%s); it counts as an end of the server", error)

    def under_way(self) -> list[Known]:
        """Jobs that are computed now; without the lock, which may be held by what hangs."""
        return list(self._threads)

    # -- the waiting line ------------------------------------------------------------------------------------

    def _is_suspect(self, row: JobRow) -> bool:
        """Whether one more end of the server would count as this job's fault."""
        return row.starts >= max(1, self._most_starts - 1)

    def _unfinished(self, session: Session, state: jobs.State) -> list[tuple[JobRow, Work]]:
        found = [(row, work) for work in self._kinds for row in store.jobs_in(session, work.table, state)]
        return sorted(found, key=lambda one: one[0].created_at)

    def _obey(self, job: Known, instructions: tuple[Instruction, ...]) -> None:
        with self._lock:
            if Instruction.ENQUEUE in instructions and job not in self._waiting:
                self._waiting.append(job)
                self._waits_since[job] = time.monotonic()
            if Instruction.DEQUEUE in instructions and job in self._waiting:
                self._take(job)
        if Instruction.PUBLISH in instructions:
            self._changes.publish(job.id)
        self._dispatch()

    def _dispatch(self) -> None:
        with self._lock:
            while self._evaluator and not self._stopping and len(self._threads) < self._at_once:
                job = self._next()
                if job is None:
                    return
                self._take(job)
                self._progressed[job] = time.monotonic()
                thread = threading.Thread(target=self._work, args=(job, self._evaluator), name=job.id, daemon=True)
                self._threads[job] = thread
                thread.start()

    def _take(self, job: Known) -> None:
        self._waiting.remove(job)
        del self._waits_since[job]

    def _next(self) -> Known | None:
        """The first that may start now. One that had better be alone waits until it is, and those behind it as well."""
        if self._suspects & self._threads.keys():
            return None
        for job in self._waiting:
            if job in self._suspects and self._threads:
                return None
            if self._may_start(job):
                return job
        return None

    def _may_start(self, job: Known) -> bool:
        """Whether no more than his share of its owner's jobs are computed, and none of this one's earlier threads.

        A job that was paused and resumed waits until its earlier thread has ended.
        """
        beside = sum(other.owner == job.owner for other in self._threads)
        return job not in self._threads and beside < self._of_one

    # -- in the job's thread ---------------------------------------------------------------------------------

    def _work(self, job: Known, evaluator: RunningEvaluator) -> None:
        lower_priority()
        try:
            self._compute(job, evaluator)
        except (DatabaseClosedError, jobs.IllegalTransition) as error:
            LOG.info("%s: left as stored (%s)", job, error)
        except InterruptedStepError:
            if not self._stopping:
                self._end(job, jobs.Fail("interrupted"))  # the wish to cancel decides
        except Exception as error:
            self._fail(job, error)
        finally:
            with self._lock:
                self._threads.pop(job, None)
                self._progressed.pop(job, None)
                self._cancelled.discard(job)
                if job not in self._waiting:  # it was paused and resumed
                    self._suspects.discard(job)
            self._dispatch()

    def _compute(self, job: Known, evaluator: RunningEvaluator) -> None:
        row, points = self._start(job)
        earlier, began = row.elapsed_seconds, time.monotonic()
        LOG.info("%s: starts after step %d", job, row.generations)
        interruptible = InterruptibleEvaluator(evaluator, lambda: self._stopping or job in self._cancelled)

        def begun() -> Iterator[Step]:
            steps = job.work.steps(row, interruptible)
            return chain([next(steps)], steps)

        # What is prepared before the first step may need room, too.
        for step in self._patiently(job, begun):
            points.append((earlier + time.monotonic() - began, step.progress))
            goes_on = self._store(job, step, points)
            if self._stopping or not goes_on:
                return

    def _patiently(self, job: Known, write: Callable[[], Written]) -> Written:
        """Write, again and again while the disk takes nothing: a job waits for room, and loses nothing."""
        waited = 0.0
        while True:
            try:
                return write()
            except (OperationalError, OSError) as error:
                if not is_full(error) or self._stopping:
                    raise
                LOG.error("%s waits: the disk is full or fails (%s)", job, getattr(error, "orig", error))
            pause = min(ROOM_SECONDS[0] + waited, ROOM_SECONDS[1])
            waited += pause
            time.sleep(pause)

    def _start(self, job: Known) -> tuple[JobRow, Points]:
        def write() -> tuple[JobRow, Points, tuple[Instruction, ...]]:
            with self._database.write() as session:
                if self._stopping:  # what starts after the stop has taken note of what runs would count as a death
                    raise InterruptedStepError
                row = store.one(session, job.work.table, job.id)
                instructions = _step(row, jobs.Start())
                return row, job.work.begin(session, row), instructions

        row, points, instructions = self._patiently(job, write)
        with self._lock:
            if job in self._waiting:  # paused and resumed since it was taken out of the line
                self._take(job)
        self._obey(job, instructions)
        return row, points

    def _store(self, job: Known, step: Step, points: Points) -> bool:
        """One step with all that it found, in one transaction; whether the job goes on."""
        eta = jobs.eta_seconds(points)

        def write() -> tuple[Instruction, ...]:
            with self._database.write() as session:
                row = store.one(session, job.work.table, job.id)
                instructions = _step(row, jobs.Finish() if step.last else jobs.Generation(step.progress, step.lasting))
                row.elapsed_seconds = points[-1][0]
                if not step.last or row.state == jobs.State.SUCCEEDED:
                    step.keep(session, row, eta)
            return instructions

        instructions = self._patiently(job, write)
        with self._lock:
            self._progressed[job] = time.monotonic()
            if step.lasting:
                self._suspects.discard(job)
        self._obey(job, (*instructions, Instruction.PUBLISH))
        return Instruction.STOP not in instructions

    def _fail(self, job: Known, error: Exception) -> None:
        if self._stopping:
            LOG.info("%s: interrupted by the stop of the service (%s)", job, error)
            return
        LOG.error("%s failed", job, exc_info=error)
        self._end(job, jobs.Fail(_failure(job, error)))

    def _end(self, job: Known, event: jobs.Fail) -> None:
        def write() -> tuple[Instruction, ...]:
            with self._database.write() as session:
                return _step(store.one(session, job.work.table, job.id), event)

        try:
            self._obey(job, self._patiently(job, write))
        except Exception as late:
            # The job stays as stored and goes on at the next start of the service.
            LOG.error("%s: end not stored (%s)", job, late)


def message(error: Exception) -> str:
    """``error`` for the user: what the domain says as it stands, a surprise with its kind; no stack trace."""
    text = with_remedy(str(error)) if _told(error) else f"{type(error).__name__}: {error}"
    return text[:LONGEST_ERROR]


def _told(error: Exception) -> bool:
    """Whether ``error`` is the domain's own word to the user."""
    return isinstance(error, ValueError) and bool(str(error))


def _failure(job: Known, error: Exception) -> str:
    """Why a job failed; a surprise is the server's fault, and said to be."""
    if _told(error):
        return message(error)
    return f"the server made a mistake ({message(error)}); the {job.work.what}'s data are kept; please report it"


def lower_priority() -> None:
    """Lower the priority of the calling thread and of the processes it starts."""
    try:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
    except OSError:
        LOG.debug("cannot lower the priority of a job")


def _step(row: JobRow, event: jobs.Event) -> tuple[Instruction, ...]:
    job, instructions = jobs.step(store.job(row), event)
    store.put_job(row, job)
    return instructions
