"""Computes a diagnosis in this process and worker processes, without a server, with the same checks and results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from wingfit.calibration.evaluator import Evaluator
from wingfit.checks import load_dataset
from wingfit.client.transport import WingfitError
from wingfit.diagnosis import DiagnosisSpec, Progress
from wingfit.diagnosis.finding import Finding
from wingfit.records import AnyDataset, SeriesDataset
from wingfit.rigs.load import RigError, load_rig
from wingfit.rigs.rig import Rig
from wingfit.service.diagnoses.checks import checked, checked_rig
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.diagnoses.requests import DiagnosisIn
from wingfit.service.http.problems import ProblemError, from_pydantic
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.simulation_hints import with_remedy
from wingfit.workers import make_evaluator
from wingfit.workers.jobs import eta_seconds

OnProgress = Callable[[float, float | None, str], None]
Steps = Callable[[Evaluator], Iterator[Progress]]


def diagnose(
    path: Path, request: dict[str, Any], workers: int | None, on_progress: OnProgress, rig: str | None = None
) -> Finding:
    """Diagnose the dataset at ``path`` and return the finding; ``request``: a body of ``POST /v1/diagnoses``.

    ``workers``: number of worker processes (None: the evaluator decides). ``on_progress`` is called with the fraction
    done, the remaining time (s, None if unknown) and the stage. ``rig``: the simulation of a dataset of series, as
    :func:`wingfit.rigs.load.load_rig` takes it. WingfitError says what is wrong.
    """
    steps = _steps(_loaded(path), request, rig)
    started, points = time.monotonic(), list[tuple[float, float]]()
    try:
        with closing(make_evaluator("processes", workers)) as evaluator:
            for progress in steps(evaluator):
                points.append((time.monotonic() - started, progress.fraction))
                on_progress(progress.fraction, eta_seconds(points), progress.stage)
                if progress.finding is not None:
                    return progress.finding
    except ValueError as error:
        raise WingfitError("the diagnosis failed", with_remedy(str(error))) from error
    raise WingfitError("the diagnosis ended without a finding")


def _steps(dataset: AnyDataset, request: dict[str, Any], reference: str | None) -> Steps:
    """Return what diagnoses ``dataset``; WingfitError where ``request`` or the rig at ``reference`` does not fit it."""
    diagnoser, rig = Diagnoser(), _rig(dataset, reference)
    try:
        body = DiagnosisIn.model_validate(request)
        spec = _spec(body, dataset, rig, diagnoser)
    except ValidationError as error:
        raise WingfitError("the request is invalid", errors=[from_pydantic(one) for one in error.errors()]) from None
    except ProblemError as problem:
        raise WingfitError(problem.detail, errors=problem.errors) from None
    return lambda evaluator: diagnoser.diagnose(spec, dataset, evaluator, rig)


def _spec(body: DiagnosisIn, dataset: AnyDataset, rig: Rig | None, diagnoser: Diagnoser) -> DiagnosisSpec:
    if isinstance(dataset, SeriesDataset):
        if rig is None:
            raise TypeError("series have a rig")
        return checked_rig(body, dataset, rig, diagnoser)
    return checked(body, dataset, Engine(), diagnoser)


def _rig(dataset: AnyDataset, reference: str | None) -> Rig | None:
    """Return the user's simulation of a dataset of series, None for others; WingfitError where that is wrong."""
    if not isinstance(dataset, SeriesDataset):
        if reference is not None:
            raise WingfitError("this dataset describes its own rig", "it has a wing or a vehicle: leave --rig out")
        return None
    if reference is None:
        raise WingfitError(
            f"this dataset has series of rig {dataset.rig!r}",
            "name its simulation: --rig my_rig.py (README, Bring your own)",
        )
    try:
        return load_rig(reference)
    except RigError as error:
        raise WingfitError("the rig cannot be loaded", str(error)) from error


def _loaded(path: Path) -> AnyDataset:
    try:
        return load_dataset(path)
    except ValueError as error:
        faults = [vars(fault) for fault in getattr(error, "errors", [])]
        raise WingfitError(f"{path} is not a valid dataset", "" if faults else str(error), errors=faults) from error
