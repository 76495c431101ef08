"""Calibration runs as jobs of the runner; an interrupted run continues after its last stored generation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from sqlalchemy.orm import Session

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.search import CalibrationSpec, Generation
from wingfit.client.answers import GenerationEvent, Run
from wingfit.records import SeriesDataset, wing_or_vehicle
from wingfit.rigs.rig import Rig
from wingfit.service.datasets.parsed_datasets import Datasets
from wingfit.service.jobs.job_kind import JobKind, Points, Step
from wingfit.service.outcomes import fit_quality, force_views
from wingfit.service.rigs import rig_runs
from wingfit.service.rigs.stored_rig import rig_of
from wingfit.service.runs import views
from wingfit.service.runs.engine import Engine
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import CheckpointRow, GenerationRow, RunRow
from wingfit.service.units import finite
from wingfit.workers import jobs


class Calibrating(JobKind):
    """The calibration run as a kind of job: how the runner computes, stores and describes a run."""

    what, path, prefix, step_event = "run", "/v1/runs", "run", "generation"
    table, step_table, step_answer = RunRow, GenerationRow, GenerationEvent

    def __init__(self, database: Database, engine: Engine, datasets: Datasets) -> None:
        self._database, self._engine, self._datasets = database, engine, datasets

    def view(self, row: RunRow) -> Run:
        """Return the JSON answer that describes the run stored in ``row``."""
        return views.run(row)

    def begin(self, session: Session, row: RunRow) -> Points:
        """Return (elapsed time in s, progress) of the stored generations, after which the run continues."""
        return [(g.elapsed_seconds, g.progress) for g in store.steps(session, GenerationRow, row.id)]

    def steps(self, row: RunRow, evaluator: Evaluator, _interrupted: Callable[[], bool]) -> Iterator[Step]:
        """Yield a step for each generation of the search, then one with the result on every recording."""
        spec, whole = store.spec(row), self._datasets.get(row.dataset_id)
        with self._database.read() as session:
            checkpoint = store.checkpoint(session, row.id)
        if isinstance(whole, SeriesDataset) and row.rig is not None:
            yield from _rig_steps(spec, rig_of(row.rig), whole, evaluator, checkpoint)
            return
        dataset = wing_or_vehicle(whole)
        for generation in self._engine.calibrate(spec, dataset, evaluator, checkpoint):
            checkpoint = generation.checkpoint
            yield _step(generation)
        if checkpoint is None:
            raise ValueError("the search ended without a generation")
        summary = self._engine.summarise(spec, dataset, evaluator, checkpoint)
        if isinstance(summary, ForceResult):
            yield _result(force_views.result(summary, spec, dataset))
        else:
            yield _result(views.result(summary))


def _rig_steps(
    spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None
) -> Iterator[Step]:
    """Yield the steps of a calibration of a rig of the user's own."""
    for generation in rig_runs.calibrate(spec, rig, dataset, evaluator, checkpoint):
        checkpoint = generation.checkpoint
        yield _step(generation)
    if checkpoint is None:
        raise ValueError("the search ended without a generation")
    yield _result(rig_runs.result(rig_runs.summarise(spec, rig, dataset, evaluator, checkpoint)))


def _step(generation: Generation) -> Step:
    """Return the step that stores one generation, with the checkpoint and best genome of the run after it."""

    def store_step(session: Session, row: RunRow, eta: float | None) -> None:
        row.stage, row.genome = generation.stage, generation.genome
        misfit = views.misfit(row.kind, generation.distance)
        row.best_mm, row.best_mn, row.best_percent = misfit["best_mm"], misfit["best_mn"], misfit["best_percent"]
        row.evaluations = generation.evaluations
        row.eta_seconds = eta if row.state == jobs.State.RUNNING else None
        session.add(_generation_row(row, generation, eta))
        session.merge(CheckpointRow(run_id=row.id, body=generation.checkpoint))

    return Step(generation.progress, store_step)


def _result(outcome: Mapping[str, Any]) -> Step:
    def store_step(_session: Session, row: RunRow, _eta: float | None) -> None:
        row.result = dict(outcome)
        fit = fit_quality.of_result(row.kind, outcome)
        row.residual_over_noise, row.held_out_over_noise = fit.residual, fit.held_out
        # While the run is running, the best of the current stage; in the end, the misfit to all fitted recordings.
        if row.kind != "series":  # of series the result is relative to noise, and the misfit of the search stays
            row.best_mm, row.best_mn = outcome.get("after_mm"), outcome.get("after_mn")

    return Step(1.0, store_step, last=True)


def _generation_row(row: RunRow, generation: Generation, eta: float | None) -> GenerationRow:
    return GenerationRow(
        job_id=row.id,
        sequence=row.generations,
        stage=generation.stage,
        generation=generation.index,
        best=finite(generation.best),
        mean=finite(generation.mean),
        diversity=finite(generation.diversity),
        **views.misfit(row.kind, generation.distance),
        evaluations=generation.evaluations,
        failed=generation.failed,
        reasons=list(generation.reasons),
        elapsed_seconds=row.elapsed_seconds,
        progress=row.progress,
        eta_seconds=eta,
    )
