"""Calibrations and diagnoses in this process, without a server."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.result import Result
from wingfit.calibration.search import calibrate as generations_of
from wingfit.calibration.spec import CalibrationSpec
from wingfit.calibration.summary import summarise
from wingfit.diagnosis import DiagnosisSpec, Finding
from wingfit.diagnosis import diagnose as steps_of
from wingfit.records import Dataset
from wingfit.workers import RunningEvaluator, make_evaluator

OnProgress = Callable[[float, str], object]


def calibrate(
    dataset: Dataset,
    spec: CalibrationSpec | None = None,
    *,
    workers: int = 1,
    on_progress: OnProgress | None = None,
) -> Result | ForceResult:
    """Estimate the genes of the dataset's model, and judge the estimate on every recording, held-out ones too.

    Args:
        dataset: recordings and the description of their rig (:func:`wingfit.load_dataset`).
        spec: what to calibrate and how; by default the settings of the sources for this kind of rig.
        workers: processes that evaluate. Numbers do not depend on it. More than one starts processes, which import the
            calling script again: call from below ``if __name__ == "__main__":``.
        on_progress: is called after each generation with the part that is done, in [0, 1], and the stage's name.

    Returns:
        A :class:`Result` for a wing (distances in m), a :class:`ForceResult` for a vehicle (forces in N).

    Raises:
        ValueError: the spec does not fit the dataset.
    """
    spec = spec or CalibrationSpec()
    checkpoint = None
    with _evaluator(workers) as evaluator:
        for generation in generations_of(spec, dataset, evaluator):
            checkpoint = generation.checkpoint
            if on_progress:
                on_progress(generation.progress, generation.stage)
        if checkpoint is None:
            raise ValueError("the search ended without a generation; check max_generations")
        return summarise(spec, dataset, evaluator, checkpoint)


def diagnose(
    dataset: Dataset,
    spec: DiagnosisSpec | None = None,
    *,
    workers: int = 1,
    on_progress: OnProgress | None = None,
) -> Finding:
    """Find what the dataset's model lacks: where it differs from the recordings, which effect explains that, and proof.

    Args:
        dataset: recordings, some of them held out for the proof.
        spec: which model, suspects and thresholds; by default all effects that apply to this kind of rig.
        workers: as in :func:`calibrate`.
        on_progress: is called with the part that is done, in [0, 1], and the name of the step.

    Raises:
        ValueError: the spec does not fit the dataset, or the dataset cannot be diagnosed; the message says why.
    """
    with _evaluator(workers) as evaluator:
        for progress in steps_of(dataset, spec or DiagnosisSpec(), evaluator):
            if on_progress:
                on_progress(progress.fraction, progress.stage)
            if progress.finding is not None:
                return progress.finding
    raise ValueError("the diagnosis ended without a finding")


@contextmanager
def _evaluator(workers: int) -> Iterator[RunningEvaluator]:
    evaluator = make_evaluator("in_process") if workers == 1 else make_evaluator("processes", workers)
    try:
        yield evaluator
    finally:
        evaluator.close()
