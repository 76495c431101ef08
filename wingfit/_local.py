"""Calibrations and diagnoses that run in this process, without a server."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.preparation import Prepared, prepare, prepare_rig
from wingfit.calibration.result import Result
from wingfit.calibration.search import calibrate_prepared
from wingfit.calibration.series.result import SeriesResult
from wingfit.calibration.spec import CalibrationSpec
from wingfit.calibration.summary import summarise, summarise_rig
from wingfit.checks.examine import examine
from wingfit.checks.load import refuse
from wingfit.diagnosis import DiagnosisSpec, Finding, Progress, diagnose_rig
from wingfit.diagnosis import diagnose as steps_of
from wingfit.planning import Plan, PlanSpec, plan_dataset, plan_rig
from wingfit.planning.description import load_planned
from wingfit.records import AnyDataset, Dataset, SeriesDataset, wing_or_vehicle
from wingfit.records.files.assemble import checked_description
from wingfit.rigs.rig import Rig, required_rig
from wingfit.workers import RunningEvaluator, make_evaluator

OnProgress = Callable[[float, str], object]


def calibrate(
    dataset: AnyDataset,
    spec: CalibrationSpec | None = None,
    *,
    rig: Rig | None = None,
    workers: int = 1,
    on_progress: OnProgress | None = None,
) -> Result | ForceResult | SeriesResult:
    """Estimate the genes of the dataset's model, and compare the estimate with every recording, held-out ones included.

    Args:
        dataset: recordings and the description of their rig (:func:`wingfit.load_dataset`).
        spec: what to calibrate and how; None: the default settings for this kind of rig, those of the published
            sources. For a rig of the user's own: a short genetic search, then Gauss-Newton.
        rig: simulation of the rig that was recorded, if it is neither a wing nor a vehicle. With more than one worker,
            its functions must be importable: defined at the top of a module.
        workers: number of processes that simulate; the results do not depend on it. More than one starts processes,
            which import the calling script again: call from below ``if __name__ == "__main__":``.
        on_progress: called after each generation of the search with the completed fraction, in [0, 1], and the name of
            the stage.

    Returns:
        A :class:`Result` for a wing (distances in m), a :class:`ForceResult` for a vehicle (forces in N), a
        :class:`SeriesResult` for a rig of the user's own (channels in their units).

    Raises:
        ValueError: the spec does not fit the dataset, or the rig does not.
    """
    spec = spec or CalibrationSpec()
    with _evaluator(workers) as evaluator:
        own = _series_of(dataset, rig)
        if own is not None:
            ready = prepare_rig(spec, own[1], own[0])
            return summarise_rig(ready, own[1], own[0], evaluator, _last_checkpoint(ready, evaluator, on_progress))
        known = _checked(dataset)
        checkpoint = _last_checkpoint(prepare(spec, known), evaluator, on_progress)
        return summarise(spec, known, evaluator, checkpoint)


def _last_checkpoint(ready: Prepared, evaluator: RunningEvaluator, on_progress: OnProgress | None) -> dict[str, Any]:
    """Run the calibration that is ``ready``, and return the checkpoint after its last generation."""
    checkpoint = None
    for generation in calibrate_prepared(ready, evaluator):
        checkpoint = generation.checkpoint
        if on_progress:
            on_progress(generation.progress, generation.stage)
    if checkpoint is None:
        raise ValueError("the search ended without a generation; check max_generations")
    return checkpoint


def diagnose(
    dataset: AnyDataset,
    spec: DiagnosisSpec | None = None,
    *,
    rig: Rig | None = None,
    workers: int = 1,
    on_progress: OnProgress | None = None,
) -> Finding:
    """Report which physics the dataset's model is missing.

    The finding says where model and recordings differ, which effect explains the difference, and whether the model with
    this effect predicts the held-out recordings.

    Args:
        dataset: recordings, some of them held out: these are never fitted and test the explanation.
        spec: model, suspects (effects to consider) and thresholds; None: all effects that apply to this kind of rig.
        rig: simulation of the rig that was recorded, if it is neither a wing nor a vehicle. With more than one worker,
            its functions must be importable: defined at the top of a module.
        workers: number of processes that simulate, as in :func:`calibrate`.
        on_progress: called with the completed fraction, in [0, 1], and the name of the step.

    Raises:
        ValueError: the spec does not fit the dataset, or the dataset cannot be diagnosed; the message says why.
    """
    with _evaluator(workers) as evaluator:
        for progress in _steps(dataset, rig, spec or DiagnosisSpec(), evaluator):
            if on_progress:
                on_progress(progress.fraction, progress.stage)
            if progress.finding is not None:
                return progress.finding
    raise ValueError("the diagnosis ended without a finding")


def _steps(
    dataset: AnyDataset, rig: Rig | None, spec: DiagnosisSpec, evaluator: RunningEvaluator
) -> Iterator[Progress]:
    own = _series_of(dataset, rig)
    return diagnose_rig(own[1], own[0], spec, evaluator) if own else steps_of(_checked(dataset), spec, evaluator)


def _checked(dataset: AnyDataset) -> Dataset:
    """Return ``dataset``, of a wing or a vehicle, checked as one that is read from files; DatasetError lists errors."""
    checked_description(dataset)
    refuse(examine(dataset))
    return wing_or_vehicle(dataset)


def _series_of(dataset: AnyDataset, rig: Rig | None) -> tuple[SeriesDataset, Rig] | None:
    """Return series with the rig that simulates them; None for a wing or vehicle. ValueError if one is missing."""
    if isinstance(dataset, str | Path):
        raise TypeError(f"dataset is {str(dataset)!r}; give the recordings themselves: wingfit.load_dataset(...)")
    if isinstance(dataset, SeriesDataset):
        if rig is None:
            raise ValueError(f"dataset {dataset.name!r} has series of rig {dataset.rig!r}; give its simulation as rig")
        return dataset, required_rig(rig)
    if rig is not None:
        raise ValueError(f"dataset {dataset.name!r} describes a {dataset.kind} rig of its own; leave out rig")
    return None


def plan(
    dataset: AnyDataset | str | Path,
    spec: PlanSpec | None = None,
    *,
    rig: Rig | None = None,
    workers: int = 1,
    on_progress: OnProgress | None = None,
) -> Plan:
    """Plan an experiment: which genes and effects its recordings will identify, and which recordings add most.

    Args:
        dataset: recordings, or the path of a dataset, or of a description of one without recordings
            (``dataset.yaml``), which lists the conditions.
        spec: noise, beats, frames, markers and model; None: as recorded or, without recordings, stated defaults.
        rig: simulation of the rig, if it is neither a wing nor a vehicle; its recordings must exist.
        workers: number of processes that simulate, as in :func:`calibrate`.
        on_progress: called with the completed fraction, in [0, 1], and what is simulated.

    Raises:
        ValueError: the spec does not fit the dataset, or a planned recording cannot be simulated.
    """
    planned = load_planned(Path(dataset)) if isinstance(dataset, str | Path) else dataset
    with _evaluator(workers) as evaluator:
        own = _series_of(planned, rig)
        if own is not None:
            return plan_rig(own[1], own[0], spec or PlanSpec(), evaluator, on_progress)
        return plan_dataset(wing_or_vehicle(planned), spec or PlanSpec(), evaluator, on_progress)


@contextmanager
def _evaluator(workers: int) -> Iterator[RunningEvaluator]:
    evaluator = make_evaluator("in_process") if workers == 1 else make_evaluator("processes", workers)
    try:
        yield evaluator
    finally:
        evaluator.close()
