"""Diagnoses: computed in one go; one that was interrupted starts again, and finds the same."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from sqlalchemy.orm import Session

from wingfit.calibration.evaluator import Evaluator
from wingfit.client.diagnosis_answers import Diagnosis, StepEvent
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.spec import Progress
from wingfit.service.datasets.parsed_datasets import Datasets
from wingfit.service.diagnoses import specs, views
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.jobs.job_kind import Points, Step
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import DiagnosisRow, FindingRow, StepRow
from wingfit.workers import jobs

# Progress in between is not stored: nobody reads so fast, and each store waits for the disk.
STORE_SECONDS = 0.5


class Diagnosing:
    """How diagnoses are computed."""

    what, path, prefix, step_event = "diagnosis", "/v1/diagnoses", "dx", "step"
    table, step_table, step_answer = DiagnosisRow, StepRow, StepEvent

    def __init__(self, database: Database, diagnoser: Diagnoser, datasets: Datasets) -> None:
        self._database, self._diagnoser, self._datasets = database, diagnoser, datasets

    def view(self, row: DiagnosisRow) -> Diagnosis:
        """The answer that describes a diagnosis."""
        return views.diagnosis(row)

    def begin(self, _session: Session, row: DiagnosisRow) -> Points:
        """Start from nothing. Sequences of steps go on, so that whoever watches misses none."""
        row.stage, row.progress, row.evaluations, row.elapsed_seconds = None, 0.0, 0, 0.0
        return []

    def steps(self, row: DiagnosisRow, evaluator: Evaluator) -> Iterator[Step]:
        """Diagnose; stages are told at once, progress within one from time to time."""
        spec, dataset = specs.stored(row.spec), self._datasets.get(row.dataset_id)
        stage, told = "", 0.0
        for progress in self._diagnoser.diagnose(spec, dataset, evaluator):
            if progress.finding is not None:
                yield _found(progress, progress.finding, self._diagnoser.stored(progress.finding))
                return
            if progress.stage != stage or time.monotonic() - told > STORE_SECONDS:
                stage, told = progress.stage, time.monotonic()
                yield _step(progress)
        raise RuntimeError("the diagnosis ended without a finding")


def _step(progress: Progress) -> Step:
    def keep(session: Session, row: DiagnosisRow, eta: float | None) -> None:
        row.stage, row.evaluations = progress.stage, progress.evaluations
        row.eta_seconds = eta if row.state == jobs.State.RUNNING else None
        step = StepRow(job_id=row.id, sequence=row.generations, stage=row.stage, progress=row.progress)
        step.evaluations, step.elapsed_seconds, step.eta_seconds = row.evaluations, row.elapsed_seconds, eta
        session.add(step)

    return Step(min(max(progress.fraction, 0.0), 1.0), keep, lasting=False)


def _found(progress: Progress, finding: Finding, stored: dict[str, Any]) -> Step:
    def keep(session: Session, row: DiagnosisRow, _eta: float | None) -> None:
        row.stage, row.evaluations = progress.stage, progress.evaluations
        row.verdict, row.summary = finding.verdict, finding.summary
        session.merge(FindingRow(diagnosis_id=row.id, body=stored))

    return Step(1.0, keep, last=True)
