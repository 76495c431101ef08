"""Computes a diagnosis in this process and worker processes, without a server, with the same checks and results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.spec import CalibrationSpec
from wingfit.client.transport import WingfitError
from wingfit.diagnosis import DiagnosisSpec, Progress, diagnose_rig
from wingfit.diagnosis.finding import Finding
from wingfit.records import AnyDataset, Dataset, SeriesDataset, load_dataset
from wingfit.rigs.load import RigError, load_rig
from wingfit.service.diagnoses.checks import checked
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.diagnoses.requests import DiagnosisIn
from wingfit.service.http.problems import ProblemError, from_pydantic
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.simulation_hints import with_remedy
from wingfit.workers import make_evaluator
from wingfit.workers.jobs import eta_seconds

OnProgress = Callable[[float, float | None, str], None]
Steps = Callable[[Evaluator], Iterator[Progress]]

RIG_SETTINGS = {"genes", "fixed", "recordings", "suspects", "refits", "name", "refine", "seed"}
"""Settings of a diagnosis that a rig of the user's own accepts; it has no finer discretisation, and draws nothing."""


def diagnose(
    path: Path, request: dict[str, Any], workers: int | None, on_progress: OnProgress, rig: str | None = None
) -> Finding:
    """Diagnose the dataset at ``path`` and return the finding; ``request``: a body of ``POST /v1/diagnoses``.

    ``workers``: number of worker processes (None: the evaluator decides). ``on_progress`` is called with the fraction
    done, the remaining time (s, None if unknown) and the stage. ``rig``: the simulation of a dataset of series, as
    :func:`wingfit.rigs.load.load_rig` takes it. WingfitError says what is wrong.
    """
    dataset = _loaded(path)
    steps = (
        _steps_of_rig(dataset, request, rig)
        if isinstance(dataset, SeriesDataset)
        else _steps_of_dataset(dataset, request, rig)
    )
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


def _steps_of_dataset(dataset: Dataset, request: dict[str, Any], rig: str | None) -> Steps:
    """Return what diagnoses a wing or vehicle; WingfitError where ``request`` does not fit it."""
    if rig is not None:
        raise WingfitError("this dataset describes its own rig", "it has a wing or a vehicle: leave --rig out")
    diagnoser = Diagnoser()
    try:
        spec = checked(DiagnosisIn.model_validate(request), dataset, Engine(), diagnoser)
    except ValidationError as error:
        raise WingfitError("the request is invalid", errors=[from_pydantic(one) for one in error.errors()]) from None
    except ProblemError as problem:
        raise WingfitError(problem.detail, errors=problem.errors) from None
    return lambda evaluator: diagnoser.diagnose(spec, dataset, evaluator)


def _steps_of_rig(dataset: SeriesDataset, request: dict[str, Any], rig: str | None) -> Steps:
    """Return what diagnoses series with the user's simulation; WingfitError where ``request`` or ``rig`` is wrong."""
    if rig is None:
        raise WingfitError(
            f"this dataset has series of rig {dataset.rig!r}",
            "name its simulation: --rig my_rig.py (README, Bring your own)",
        )
    unknown = sorted(set(request) - RIG_SETTINGS)
    if unknown:
        known = ", ".join(sorted(RIG_SETTINGS))
        raise WingfitError(f"a rig of your own has no setting {unknown[0]!r}", f"leave it out; there are {known}")
    calibration = CalibrationSpec(
        genes=tuple(request.get("genes", ())),
        fixed=request.get("fixed", {}),
        recordings=tuple(request.get("recordings", ())),
    )
    spec = DiagnosisSpec(calibration, suspects=tuple(request.get("suspects", ())), refits=request.get("refits", 8))
    try:
        loaded = load_rig(rig)
    except RigError as error:
        raise WingfitError("the rig cannot be loaded", str(error)) from error
    return lambda evaluator: diagnose_rig(loaded, dataset, spec, evaluator)


def _loaded(path: Path) -> AnyDataset:
    try:
        return load_dataset(path)
    except ValueError as error:
        faults = [vars(fault) for fault in getattr(error, "errors", [])]
        raise WingfitError(f"{path} is not a valid dataset", "" if faults else str(error), errors=faults) from error
