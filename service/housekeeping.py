"""What is forgotten by itself: answers that nobody repeats, and, where it is asked for, jobs that ended long ago."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from datetime import UTC, datetime, timedelta

from sqlalchemy import select

from service import store
from service.database import Database, DatabaseClosedError
from service.tables import DiagnosisRow, RunRow

LOG = logging.getLogger("wingfit")
EVERY_SECONDS = 3600.0


class Housekeeping:
    """Tidies at the start and every hour; datasets are never forgotten."""

    def __init__(self, database: Database, keep_days: int | None, on_deleted: Callable[[str], None]) -> None:
        self._database, self._keep_days, self._on_deleted = database, keep_days, on_deleted
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._go, name="housekeeping", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Do nothing more."""
        self._stop.set()

    def tidy(self) -> int:
        """Tidy once; the number of jobs forgotten."""
        with self._database.write() as session:
            store.forget_answers(session)
        if self._keep_days is None:
            return 0
        ended = self._ended_before(store.timestamp(datetime.now(UTC) - timedelta(days=self._keep_days)))
        for table, job_id in ended:  # one transaction each: nobody waits long for the one that writes
            if self._stop.is_set():
                break
            with self._database.write() as session:
                session.delete(session.scalars(select(table).where(table.id == job_id)).one())
            self._on_deleted(job_id)
        if ended:
            LOG.info("%d jobs that ended more than %d days ago were deleted", len(ended), self._keep_days)
        return len(ended)

    def _ended_before(self, moment: str) -> list[tuple[type[RunRow] | type[DiagnosisRow], str]]:
        tables: tuple[type[RunRow] | type[DiagnosisRow], ...] = (DiagnosisRow, RunRow)
        with self._database.read() as session:
            return [
                (table, job_id)
                for table in tables
                for job_id in session.scalars(select(table.id).where(table.finished_at < moment))
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
