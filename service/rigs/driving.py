"""Jobs whose simulations are computed by drivers, as the runner and the routes use them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sqlalchemy import select
from sqlalchemy.orm import Session

from wingfit.rigs.rig_model import Simulated
from wingfit.service.rigs.board import Board
from wingfit.service.rigs.driven_evaluator import DrivenEvaluator
from wingfit.service.rigs.kept_simulations import KeptSimulations
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import DiagnosisRow, RunRow
from wingfit.workers.jobs import State


class Driving:
    """The open simulations of driven jobs (``board``), and the stored results of earlier ones."""

    def __init__(self, database: Database) -> None:
        self._database, self.board, self._kept = database, Board(), KeptSimulations(database)

    def attended(self, job_id: str) -> bool:
        """Return whether a driver serves the job at present."""
        return self.board.attended(job_id)

    def evaluator(self, job_id: str) -> DrivenEvaluator:
        """Return the evaluator of the job."""
        return DrivenEvaluator(job_id, self.board, self._kept)

    def settle(
        self, job_id: str, driver: str, results: Mapping[str, Simulated], wanted: Callable[[Session], bool]
    ) -> bool:
        """Store the ``results`` of a driver by key, first in the database, then for the job that waits for them.

        Does nothing, and returns False, if ``wanted(session)`` is False because the job has ended.
        """
        if not self._kept.write(job_id, results, wanted):
            return False
        self.board.settle(job_id, driver, results)
        return True

    def left(self, job_id: str) -> None:
        """Drop what is open for a job that no longer runs; waiting drivers are woken, and learn its state."""
        (self.board.forget if self._is_over(job_id) else self.board.clear)(job_id)
        self._kept.forget(job_id)

    def _is_over(self, job_id: str) -> bool:
        with self._database.read() as session:
            states = [session.scalar(select(table.state).where(table.id == job_id)) for table in (RunRow, DiagnosisRow)]
        found = [state for state in states if state is not None]
        return not found or State(found[0]).final
