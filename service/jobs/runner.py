"""Computes jobs, a few at a time, one thread each; every step is stored before the next starts.

The state machine :mod:`wingfit.workers.jobs` decides what a job may do next and returns instructions, which the runner
carries out. A :class:`wingfit.service.jobs.job_kind.JobKind` computes the steps. A job is computed only while its
thread lives, so after any end of the process the database contains what remains to be done.
"""

from __future__ import annotations

import logging
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
from wingfit.service.jobs.job_kind import InterruptedStepError, JobKind, NotReadyError, Points, Step
from wingfit.service.jobs.wakeups import Changes
from wingfit.service.rigs.driving import Driving
from wingfit.service.runs.simulation_hints import with_remedy
from wingfit.service.storage import store
from wingfit.service.storage.database import Database, DatabaseClosedError, is_full
from wingfit.service.storage.tables import DatasetJobRow, JobRow
from wingfit.workers import RunningEvaluator, jobs
from wingfit.workers.jobs import Instruction
from wingfit.workers.share import lower_priority

LOG = logging.getLogger("wingfit.runs")
LONGEST_ERROR = 1000
MOST_DRIVEN, MOST_DRIVEN_OF_ONE = 16, 4  # jobs that drivers simulate, at the same time; those of one owner
RETRY_SECONDS = (0.5, 15.0)  # between attempts to write to a full disk: the first and the longest pause

Written = TypeVar("Written")


class JobRef(NamedTuple):
    """Identifies a job: its kind, id and owner, and whether drivers compute its simulations."""

    kind: JobKind
    id: str
    owner: str | None
    driven: bool = False

    @classmethod
    def of(cls, kind: JobKind, row: JobRow) -> JobRef:
        """Return the job that ``row`` stores."""
        return cls(kind, row.id, row.owner, isinstance(row, DatasetJobRow) and bool(row.driven))

    def __str__(self) -> str:
        return f"{self.kind.what} {self.id}"


class Pace(NamedTuple):
    """Signs of a hanging computation, for the metrics (0 where no job runs or waits; without those that users drive).

    ``stalled_s``: seconds since the last stored step, of the running job for which they are most; ``waited_s``: seconds
    that the oldest queued job has waited.
    """

    stalled_s: float
    waited_s: float


class Runner:
    """Queues jobs, and owns the threads that compute them."""

    def __init__(
        self,
        database: Database,
        changes: Changes,
        kinds: Sequence[JobKind],
        at_once: int,
        of_one: int | None = None,
        most_starts: int = jobs.MOST_STARTS,
        *,
        driving: Driving,
    ) -> None:
        """Compute at most ``at_once`` jobs at a time, at most ``of_one`` of them for one owner (None: ``at_once``).

        ``kinds``: the kinds of job; ``changes``: notified of every change of a job; ``most_starts``: a job fails if the
        server crashed that many times while the job ran without progress; ``driving``: of jobs that drivers simulate.
        """
        self._database, self._changes, self._kinds, self._driving = database, changes, kinds, driving
        self._at_once, self._of_one, self._most_starts = at_once, of_one or at_once, most_starts
        self._lock = threading.RLock()
        self._waiting: deque[JobRef] = deque()
        self._waits_since: dict[JobRef, float] = {}
        self._progressed: dict[JobRef, float] = {}
        self._cancelled: set[JobRef] = set()
        # Jobs that may have ended the server: each runs alone, so that no other job is blamed for it.
        self._suspects: set[JobRef] = set()
        self._threads: dict[JobRef, threading.Thread] = {}
        self._evaluator: RunningEvaluator | None = None
        self._stopping = False

    # -- from outside ----------------------------------------------------------------------------------------

    def recover(self) -> None:
        """Queue the jobs that an earlier process did not finish: those it was computing, then those it had queued."""
        with self._lock:
            with self._database.write() as session:
                left = [
                    (row, JobRef.of(kind, row))
                    for state in (jobs.State.RUNNING, jobs.State.QUEUED)
                    for row, kind in self._unfinished(session, state)
                ]
                todo = [(job, _step(row, jobs.Restart(self._most_starts))) for row, job in left]
                self._suspects = {job for row, job in left if self._is_suspect(row) and not job.driven}
            for job, instructions in todo:
                self._obey(job, instructions)

    def attach(self, evaluator: RunningEvaluator) -> None:
        """Set the ``evaluator`` of all jobs, and start to compute queued jobs."""
        with self._lock:
            self._evaluator = evaluator
        self._dispatch()

    def enqueue(self, job: JobRef) -> None:
        """Put a new job, already stored as QUEUED, at the end of the queue."""
        self._obey(job, (Instruction.ENQUEUE, Instruction.PUBLISH))

    def wake(self) -> None:
        """Start queued jobs that were not ready and now are."""
        self._dispatch()

    def control(self, kind: JobKind, job_id: str, event: jobs.Event) -> JobRow:
        """Apply ``event`` (cancel, pause or resume, requested by a user) to a job; return the job's new row.

        Raises a 409 if the state of the job does not allow the event, a 404 if there is no such job.
        """
        with self._lock:
            with self._database.write() as session:
                row = store.one(session, kind.table, job_id)
                job = JobRef.of(kind, row)
                if row.state == jobs.State.RUNNING and job not in self._threads and not self._stopping:
                    _step(row, jobs.Restart(self._most_starts))  # the end of its thread could not be stored
                try:
                    instructions = _step(row, event)
                except jobs.IllegalTransition as error:
                    raise conflict(f"{job}: {error}", state=row.state) from None
            if row.wish == jobs.Wish.CANCEL:
                self._cancelled.add(job)
            if Instruction.ENQUEUE in instructions and self._is_suspect(row) and not job.driven:
                self._suspects.add(job)
            self._obey(job, (*instructions, Instruction.PUBLISH))
        return row

    def begin_stop(self) -> None:
        """Start no more jobs; errors from now on do not make a job fail. May be called in a signal handler."""
        self._stopping = True

    def stop(self, timeout: float) -> bool:
        """Start no more jobs, and wait up to ``timeout`` s for the current steps; return whether all threads ended."""
        self.begin_stop()
        deadline = time.monotonic() + timeout
        self._leave()
        with self._lock:
            threads = list(self._threads.values())
        for thread in threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in threads)

    def pace(self) -> Pace:
        """Return how long running jobs have made no progress, and how long queued jobs have waited."""
        with self._lock:
            now = time.monotonic()
            stalled = [now - since for job, since in self._progressed.items() if not job.driven]
            waited = [now - since for job, since in self._waits_since.items() if not job.driven]
            return Pace(max(stalled, default=0.0), max(waited, default=0.0))

    def _leave(self) -> None:
        """Store that the server stops in an orderly way, so that the running jobs are not suspected of a crash."""
        try:
            with self._database.write() as session:
                for row, _ in self._unfinished(session, jobs.State.RUNNING):
                    _step(row, jobs.Leave())
        except (DatabaseClosedError, OperationalError) as error:
            LOG.warning("the stop is not stored (%s); it counts as an end of the server", error)

    def under_way(self) -> list[JobRef]:
        """Return the jobs that are computed now, without taking the lock, which a hanging thread may hold."""
        return list(self._threads)

    # -- the waiting line ------------------------------------------------------------------------------------

    def _is_suspect(self, row: JobRow) -> bool:
        """Return whether the job fails if the server crashes once more while it runs, as the probable cause."""
        return row.starts >= max(1, self._most_starts - 1)

    def _unfinished(self, session: Session, state: jobs.State) -> list[tuple[JobRow, JobKind]]:
        found = [(row, kind) for kind in self._kinds for row in store.jobs_in(session, kind.table, state)]
        return sorted(found, key=lambda one: one[0].created_at)

    def _obey(self, job: JobRef, instructions: tuple[Instruction, ...]) -> None:
        with self._lock:
            if Instruction.ENQUEUE in instructions and job not in self._waiting:
                self._waiting.append(job)
                self._waits_since[job] = time.monotonic()
            if Instruction.DEQUEUE in instructions and job in self._waiting:
                self._take(job)
        if Instruction.PUBLISH in instructions:
            self._changes.publish(job.id)
            if job.driven:
                self._driving.board.changes.publish(job.id)
        self._dispatch()

    def _dispatch(self) -> None:
        with self._lock:
            while self._evaluator and not self._stopping:
                job = self._next()
                if job is None:
                    return
                self._take(job)
                self._progressed[job] = time.monotonic()
                thread = threading.Thread(target=self._work, args=(job, self._evaluator), name=job.id, daemon=True)
                self._threads[job] = thread
                thread.start()

    def _take(self, job: JobRef) -> None:
        self._waiting.remove(job)
        del self._waits_since[job]

    def _next(self) -> JobRef | None:
        """Return the first queued job that may start now, or None.

        A suspect (a job that may have crashed the server), and all jobs queued behind it, wait until no other job runs.
        """
        if self._suspects & self._threads.keys():
            return None
        for job in self._waiting:
            if job in self._suspects and self._threads:
                return None
            if self._may_start(job):
                return job
        return None

    def _may_start(self, job: JobRef) -> bool:
        """Return whether fewer than the permitted number of jobs run, of all and of this owner, and this one does not.

        A job that was paused and resumed at once may still have its earlier thread. Jobs that drivers simulate, which
        take little of this machine, are counted by themselves; they also need a driver.
        """
        most, of_one = (MOST_DRIVEN, MOST_DRIVEN_OF_ONE) if job.driven else (self._at_once, self._of_one)
        beside = [other.owner for other in self._threads if other.driven == job.driven]
        is_ready = not job.driven or self._driving.attended(job.id)
        return is_ready and job not in self._threads and len(beside) < most and beside.count(job.owner) < of_one

    # -- in the job's thread ---------------------------------------------------------------------------------

    def _work(self, job: JobRef, evaluator: RunningEvaluator) -> None:
        lower_priority()
        try:
            self._compute(job, evaluator)
        except (DatabaseClosedError, jobs.IllegalTransition) as error:
            LOG.info("%s: left as stored (%s)", job, error)
        except InterruptedStepError:
            if not self._stopping:
                self._end(job, jobs.Fail("interrupted"))  # becomes CANCELLED where that is pending
        except NotReadyError as error:
            if not self._stopping:
                LOG.info("%s: goes back to the queue (%s)", job, error)
                self._end(job, jobs.Wait())
        except Exception as error:
            self._fail(job, error)
        finally:
            if job.driven:
                self._driving.left(job.id)
            with self._lock:
                self._threads.pop(job, None)
                self._progressed.pop(job, None)
                self._cancelled.discard(job)
                if job not in self._waiting:  # it was paused and resumed
                    self._suspects.discard(job)
            self._dispatch()

    def _compute(self, job: JobRef, evaluator: RunningEvaluator) -> None:
        row, points = self._start(job)
        earlier, began = row.elapsed_seconds, time.monotonic()
        LOG.info("%s: starts after step %d", job, row.generations)
        used = self._driving.evaluator(job.id) if job.driven else evaluator

        def interrupted() -> bool:
            return self._stopping or job in self._cancelled

        def first_step() -> Iterator[Step]:
            steps = job.kind.steps(row, InterruptibleEvaluator(used, interrupted), interrupted)
            return chain([next(steps)], steps)

        # The preparation of the first step may need disk space, too.
        for step in self._patiently(job, first_step):
            points.append((earlier + time.monotonic() - began, step.progress))
            if not self._store(job, step, points) or self._stopping:
                return

    def _patiently(self, job: JobRef, write: Callable[[], Written]) -> Written:
        """Call ``write`` and return its result; while the disk is full, wait and call ``write`` again."""
        waited = 0.0
        while True:
            try:
                return write()
            except (OperationalError, OSError) as error:
                if not is_full(error) or self._stopping:
                    raise
                LOG.error("%s waits: the disk is full or fails (%s)", job, getattr(error, "orig", error))
            pause = min(RETRY_SECONDS[0] + waited, RETRY_SECONDS[1])
            waited += pause
            time.sleep(pause)

    def _start(self, job: JobRef) -> tuple[JobRow, Points]:
        def write() -> tuple[JobRow, Points, tuple[Instruction, ...]]:
            with self._database.write() as session:
                if self._stopping:  # a start after _leave() would count as an unexpected end of the server
                    raise InterruptedStepError
                row = store.one(session, job.kind.table, job.id)
                instructions = _step(row, jobs.Start())
                return row, job.kind.begin(session, row), instructions

        row, points, instructions = self._patiently(job, write)
        with self._lock:
            if job in self._waiting:  # paused and resumed since it was taken out of the line
                self._take(job)
        self._obey(job, instructions)
        return row, points

    def _store(self, job: JobRef, step: Step, points: Points) -> bool:
        """Store the results of ``step`` and the job's new state in one transaction; return whether the job continues.

        ``points``: (elapsed time in s, progress) of all steps so far, from which the remaining time is estimated.
        """
        eta = jobs.eta_seconds(points)

        def write() -> tuple[Instruction, ...]:
            with self._database.write() as session:
                row = store.one(session, job.kind.table, job.id)
                instructions = _step(
                    row, jobs.Finish() if step.last else jobs.Generation(step.progress, step.resumable)
                )
                row.elapsed_seconds = points[-1][0]
                if not step.last or row.state == jobs.State.SUCCEEDED:
                    step.store(session, row, eta)
            return instructions

        instructions = self._patiently(job, write)
        with self._lock:
            self._progressed[job] = time.monotonic()
            if step.resumable:
                self._suspects.discard(job)
        self._obey(job, (*instructions, Instruction.PUBLISH))
        return Instruction.STOP not in instructions

    def _fail(self, job: JobRef, error: Exception) -> None:
        if self._stopping:
            LOG.info("%s: interrupted by the stop of the service (%s)", job, error)
            return
        LOG.error("%s failed", job, exc_info=error)
        self._end(job, jobs.Fail(_failure(job, error)))

    def _end(self, job: JobRef, event: jobs.Fail | jobs.Wait) -> None:
        def write() -> tuple[Instruction, ...]:
            with self._database.write() as session:
                return _step(store.one(session, job.kind.table, job.id), event)

        try:
            self._obey(job, self._patiently(job, write))
        except Exception as late:
            # The job stays as stored and goes on at the next start of the service.
            LOG.error("%s: end not stored (%s)", job, late)


def message(error: Exception) -> str:
    """Return the text of ``error`` for the user, without stack trace, with a remedy for known simulation failures.

    An error without a message for users is preceded by the name of its exception.
    """
    text = with_remedy(str(error)) if _is_for_user(error) else f"{type(error).__name__}: {error}"
    return text[:LONGEST_ERROR]


def _is_for_user(error: Exception) -> bool:
    """Return whether the message of ``error`` is meant for the user: ValueErrors of the models and the estimation."""
    return isinstance(error, ValueError) and bool(str(error))


def _failure(job: JobRef, error: Exception) -> str:
    """Return why a job failed; an error without a message for users is described as a fault of the server."""
    if _is_for_user(error):
        return message(error)
    return f"the server made a mistake ({message(error)}); the {job.kind.what}'s data are kept; please report it"


def _step(row: JobRow, event: jobs.Event) -> tuple[Instruction, ...]:
    job, instructions = jobs.step(store.job(row), event)
    store.put_job(row, job)
    return instructions
