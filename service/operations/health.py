"""The health of the service, determined without a pool thread or a lock, which a slow request may hold."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence

from sqlalchemy import inspect

from wingfit.client.answers import Health as HealthAnswer
from wingfit.service.http import threads
from wingfit.service.jobs.evaluator_startup import Pool
from wingfit.service.jobs.job_kind import JobKind
from wingfit.service.settings import Settings
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.version import wingfit_version

# Time that a caller waits for the database; most service managers stop waiting after a few seconds.
READ_SECONDS = 1.0

_COUNT = "SELECT state, count(*) FROM {} GROUP BY state"

Jobs = dict[str, dict[str, int]]


class Health:
    """Determines the health of the service; a separate thread counts jobs, and concurrent callers share one count."""

    def __init__(self, settings: Settings, database: Database, pool: Pool, kinds: Sequence[JobKind]) -> None:
        self._settings, self._database, self._pool, self._kinds = settings, database, pool, kinds
        self._counting = threads.SharedCall("health", self._count)
        self.jobs: Jobs | None = None
        """Number of jobs of all owners by kind and state; None if the database did not answer in time."""

    async def look(self) -> str | None:
        """Count the jobs again and store the numbers in ``jobs``; return None, or the reason why that failed."""
        try:
            self.jobs = await self._counting.result(READ_SECONDS)
        except TimeoutError:
            self.jobs = None
            return f"the database does not answer within {READ_SECONDS:g} s"
        except sqlite3.Error as error:
            self.jobs = None
            return f"the database cannot be read: {error}"
        return None

    async def now(self) -> HealthAnswer:
        """Return the health of the service as the JSON answer; jobs of all owners are counted, for every caller."""
        silent = await self.look()
        active = {kind.what: None if self.jobs is None else _active(self.jobs[kind.what]) for kind in self._kinds}
        return HealthAnswer(
            status="degraded" if silent else self._pool.status,
            version=wingfit_version(),
            sqlite_version=sqlite3.sqlite_version,
            evaluator=self._settings.evaluator,
            workers=self._pool.workers,
            runs_active=active["run"],
            diagnoses_active=active["diagnosis"],
            trackings_active=active["tracking"],
            detail="; ".join(reason for reason in (silent, self._pool.detail) if reason) or None,
        )

    def _count(self) -> Jobs:
        with self._database.look() as look:
            return {
                kind.what: dict(look.execute(_COUNT.format(inspect(kind.table).local_table))) for kind in self._kinds
            }


def _active(states: dict[str, int]) -> int:
    return sum(count for state, count in states.items() if state in store.ACTIVE)
