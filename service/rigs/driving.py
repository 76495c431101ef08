"""Jobs whose simulations are computed by drivers, as the runner and the routes use them."""

from __future__ import annotations

from collections.abc import Mapping

from wingfit.rigs.rig_model import Simulated
from wingfit.service.rigs.board import Board
from wingfit.service.rigs.driven_evaluator import DrivenEvaluator
from wingfit.service.rigs.kept_simulations import KeptSimulations
from wingfit.service.storage.database import Database


class Driving:
    """The open simulations of driven jobs (``board``), and the stored results of earlier ones."""

    def __init__(self, database: Database) -> None:
        self.board, self._kept = Board(), KeptSimulations(database)

    def attended(self, job_id: str) -> bool:
        """Return whether a driver serves the job at present."""
        return self.board.attended(job_id)

    def evaluator(self, job_id: str) -> DrivenEvaluator:
        """Return the evaluator of the job."""
        return DrivenEvaluator(job_id, self.board, self._kept)

    def settle(self, job_id: str, results: Mapping[str, Simulated]) -> None:
        """Store the ``results`` of a driver by key, first in the database, then for the job that waits for them."""
        self._kept.write(job_id, results)
        self.board.settle(job_id, results)

    def left(self, job_id: str) -> None:
        """Drop what is open for a job that no longer runs; waiting drivers are woken, and learn its state."""
        self.board.clear(job_id)
        self._kept.forget(job_id)
