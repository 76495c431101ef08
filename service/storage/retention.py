"""Retention: deletes old answers to repeated requests and, if WINGFIT_KEEP_DAYS is set, jobs that ended long ago."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from wingfit.service.storage import store
from wingfit.service.storage.clock import DAY, ServiceClock
from wingfit.service.storage.database import Database, DatabaseClosedError
from wingfit.service.storage.tables import JobRow

LOG = logging.getLogger("wingfit")
EVERY_SECONDS = 3600.0

TABLES = store.JOBS[::-1]


class Housekeeping:
    """Thread that deletes old data at the start and every hour: stored answers, and jobs that ended long ago.

    Jobs are deleted only if ``keep_days`` is not None, datasets never; ``on_deleted`` is called with the id of each
    job. The service clock (`clock.py`) measures how long ago a job ended, from the first pass that found the job ended.
    The wall time of the end is not used, because the wall clock may have been wrong.
    """

    def __init__(
        self,
        database: Database,
        keep_days: int | None,
        on_deleted: Callable[[str], None],
        clock: ServiceClock | None = None,
    ) -> None:
        self._database, self._keep_days, self._on_deleted = database, keep_days, on_deleted
        self._clock = clock or ServiceClock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._go, name="housekeeping", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Make the thread end before it deletes anything more."""
        self._stop.set()

    def tidy(self) -> int:
        """Make one pass: delete old answers and, if configured, old jobs; return the number of deleted jobs."""
        with self._database.write() as session:
            store.forget_answers(session)
            now = self._clock.advance(session)
            _note_ends(session, now)  # even without a limit, which may be set later
        if self._keep_days is None:
            return 0
        ended = self._ended_before(now - self._keep_days * DAY)
        for table, job_id in ended:  # one transaction each, so that other writes wait only shortly
            if self._stop.is_set():
                break
            with self._database.write() as session:
                row = session.scalar(select(table).where(table.id == job_id))
                if row is not None:  # it may have been deleted meanwhile
                    session.delete(row)
            self._on_deleted(job_id)
        if ended:
            LOG.info("%d jobs that ended more than %d days ago were deleted", len(ended), self._keep_days)
        return len(ended)

    def _ended_before(self, seconds: float) -> list[tuple[type[JobRow], str]]:
        with self._database.read() as session:
            return [
                (table, job_id)
                for table in TABLES
                for job_id in session.scalars(select(table.id).where(table.ended_at_service_seconds < seconds))
            ]

    def _go(self) -> None:
        while True:
            try:
                self.tidy()
            except DatabaseClosedError:
                return
            except Exception:
                LOG.exception("tidying failed; it is tried again in an hour")
            if self._stop.wait(EVERY_SECONDS):
                return


def _note_ends(session: Session, now: float) -> None:
    """Store ``now``, the reading of the service clock (s), with the jobs that have ended since the last pass."""
    for table in TABLES:
        new = table.finished_at.is_not(None), table.ended_at_service_seconds.is_(None)
        session.execute(update(table).where(*new).values(ended_at_service_seconds=now))
