"""Diagnoses as jobs of the runner; an interrupted one is computed again from the beginning, with equal results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import Any

from sqlalchemy import delete
from sqlalchemy.orm import Session

from wingfit.calibration.evaluator import Evaluator
from wingfit.client.diagnosis_answers import Diagnosis, StepEvent
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.spec import Progress
from wingfit.service.datasets.parsed_datasets import Datasets
from wingfit.service.diagnoses import views
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.jobs.job_kind import JobKind, Points, Step
from wingfit.service.outcomes import fit_quality
from wingfit.service.rigs.stored_rig import rig_of
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import DiagnosisRow, FindingRow, PartialRow, StepRow
from wingfit.workers import jobs

# Progress is stored at most this often within a stage: each transaction waits for the disk.
STORE_SECONDS = 0.5


class Diagnosing(JobKind):
    """The diagnosis as a kind of job: how the runner computes, stores and describes a diagnosis."""

    what, path, prefix, step_event = "diagnosis", "/v1/diagnoses", "dx", "step"
    table, step_table, step_answer = DiagnosisRow, StepRow, StepEvent

    def __init__(self, database: Database, diagnoser: Diagnoser, datasets: Datasets) -> None:
        self._database, self._diagnoser, self._datasets = database, diagnoser, datasets

    def view(self, row: DiagnosisRow) -> Diagnosis:
        """Return the JSON answer that describes the diagnosis stored in ``row``."""
        return views.diagnosis(row)

    def begin(self, session: Session, row: DiagnosisRow) -> Points:
        """Reset the progress in ``row``; return no steps, because a diagnosis always starts from the beginning.

        The sequence numbers of steps continue, so that event streams miss none.
        """
        row.stage, row.progress, row.evaluations, row.elapsed_seconds = None, 0.0, 0, 0.0
        _forget_partial(session, row)
        return []

    def steps(self, row: DiagnosisRow, evaluator: Evaluator, _interrupted: Callable[[], bool]) -> Iterator[Step]:
        """Yield a step at each new stage of the diagnosis, and within a stage at most every STORE_SECONDS."""
        spec, dataset = views.spec(row), self._datasets.get(row.dataset_id)
        rig = None if row.rig is None else rig_of(row.rig)
        stage, stored_at = "", 0.0
        for progress in self._diagnoser.diagnose(spec, dataset, evaluator, rig):
            if progress.finding is not None:
                yield _finding(progress, progress.finding, self._diagnoser.stored(progress.finding))
                return
            if progress.stage != stage or time.monotonic() - stored_at > STORE_SECONDS:
                stage, stored_at = progress.stage, time.monotonic()
                yield _step(progress)
        raise RuntimeError("the diagnosis ended without a finding")


def _step(progress: Progress) -> Step:
    def store_step(session: Session, row: DiagnosisRow, eta: float | None) -> None:
        row.stage, row.evaluations = progress.stage, progress.evaluations
        row.eta_seconds = eta if row.state == jobs.State.RUNNING else None
        step = StepRow(job_id=row.id, sequence=row.generations, stage=row.stage, progress=row.progress)
        step.evaluations, step.elapsed_seconds, step.eta_seconds = row.evaluations, row.elapsed_seconds, eta
        session.add(step)
        if progress.partial is not None:
            session.merge(PartialRow(diagnosis_id=row.id, body=asdict(progress.partial)))

    return Step(min(max(progress.fraction, 0.0), 1.0), store_step, resumable=False)


def _finding(progress: Progress, finding: Finding, stored: dict[str, Any]) -> Step:
    def store_step(session: Session, row: DiagnosisRow, _eta: float | None) -> None:
        row.stage, row.evaluations = progress.stage, progress.evaluations
        row.verdict, row.summary = finding.verdict, finding.summary
        fit = fit_quality.of_finding(finding)
        row.residual_over_noise, row.held_out_over_noise = fit.residual, fit.held_out
        session.merge(FindingRow(diagnosis_id=row.id, body=stored))
        _forget_partial(session, row)

    return Step(1.0, store_step, last=True)


def _forget_partial(session: Session, row: DiagnosisRow) -> None:
    session.execute(delete(PartialRow).where(PartialRow.diagnosis_id == row.id))
