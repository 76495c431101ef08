"""Results that drivers returned, in the database: a job that starts again, after a crash or a pause, finds them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from sqlalchemy import func, insert, select
from sqlalchemy.orm import Session

from wingfit.rigs.rig_model import Simulated
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import SimulatedRow

MOST_BYTES = 256 * 10**6  # of one job; results beyond are not stored, and computed again if the job starts again
AT_ONCE = 500  # keys in one query


class KeptSimulations:
    """Reads and writes the results of simulations of a job by the key of their call; deleted when the job ends."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._bytes: dict[str, int] = {}

    def read(self, job_id: str, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Simulated]:
        """Return the stored results among the keys of ``shapes``, which has the shape (T, C) of each."""
        found, keys = dict[str, Simulated](), list(shapes)
        with self._database.read() as session:
            for start in range(0, len(keys), AT_ONCE):
                some = keys[start : start + AT_ONCE]
                rows = select(SimulatedRow).where(SimulatedRow.job_id == job_id, SimulatedRow.key.in_(some))
                found |= {row.key: _result(row, shapes[row.key]) for row in session.scalars(rows)}
        return found

    def write(self, job_id: str, results: Mapping[str, Simulated], wanted: Callable[[Session], bool]) -> bool:
        """Store ``results`` by key, up to MOST_BYTES for the job, unless ``wanted(session)`` is False by now.

        Returns whether they are wanted.
        """
        rows = [_row(job_id, key, one) for key, one in results.items()]
        size = sum(one.channels.nbytes if one.reason is None else len(one.reason) for one in results.values())
        with self._database.write() as session:
            if not wanted(session):
                return False
            if job_id not in self._bytes:
                stored = select(func.sum(func.length(SimulatedRow.channels))).where(SimulatedRow.job_id == job_id)
                self._bytes[job_id] = session.scalar(stored) or 0
            if rows and self._bytes[job_id] + size <= MOST_BYTES:
                session.execute(insert(SimulatedRow).prefix_with("OR IGNORE"), rows)
                self._bytes[job_id] += size
        return True

    def forget(self, job_id: str) -> None:
        """Forget the size of what is stored for a job that has ended."""
        self._bytes.pop(job_id, None)


def _result(row: SimulatedRow, shape: tuple[int, ...]) -> Simulated:
    if row.channels is None:
        return Simulated(np.full(shape, np.nan), row.reason)
    return Simulated(np.frombuffer(row.channels, "<f8").astype(float).reshape(shape), None)


def _row(job_id: str, key: str, result: Simulated) -> dict[str, object]:
    channels = None if result.reason is not None else np.ascontiguousarray(result.channels, "<f8").tobytes()
    return {"job_id": job_id, "key": key, "channels": channels, "reason": result.reason}
