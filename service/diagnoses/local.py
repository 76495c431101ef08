"""Computes a diagnosis in this process and worker processes, without a server, with the same checks and results."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from wingfit.client.transport import WingfitError
from wingfit.diagnosis.finding import Finding
from wingfit.records import Dataset, load_dataset, wing_or_vehicle
from wingfit.service.diagnoses.checks import checked
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.diagnoses.requests import DiagnosisIn
from wingfit.service.http.problems import ProblemError, from_pydantic
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.simulation_hints import with_remedy
from wingfit.workers import make_evaluator
from wingfit.workers.jobs import eta_seconds

OnProgress = Callable[[float, float | None, str], None]


def diagnose(path: Path, request: dict[str, Any], workers: int | None, on_progress: OnProgress) -> Finding:
    """Diagnose the dataset at ``path`` and return the finding; ``request``: a body of ``POST /v1/diagnoses``.

    ``workers``: number of worker processes (None: the evaluator decides). ``on_progress`` is called with the fraction
    done, the remaining time (s, None if unknown) and the stage. WingfitError says what is wrong.
    """
    dataset, diagnoser = _loaded(path), Diagnoser()
    try:
        spec = checked(DiagnosisIn.model_validate(request), dataset, Engine(), diagnoser)
    except ValidationError as error:
        raise WingfitError("the request is invalid", errors=[from_pydantic(one) for one in error.errors()]) from None
    except ProblemError as problem:
        raise WingfitError(problem.detail, errors=problem.errors) from None
    started, points = time.monotonic(), list[tuple[float, float]]()
    try:
        with closing(make_evaluator("processes", workers)) as evaluator:
            for progress in diagnoser.diagnose(spec, dataset, evaluator):
                points.append((time.monotonic() - started, progress.fraction))
                on_progress(progress.fraction, eta_seconds(points), progress.stage)
                if progress.finding is not None:
                    return progress.finding
    except ValueError as error:
        raise WingfitError("the diagnosis failed", with_remedy(str(error))) from error
    raise WingfitError("the diagnosis ended without a finding")


def _loaded(path: Path) -> Dataset:
    try:
        dataset = load_dataset(path)
    except ValueError as error:
        faults = [vars(fault) for fault in getattr(error, "errors", [])]
        raise WingfitError(f"{path} is not a valid dataset", "" if faults else str(error), errors=faults) from error
    try:
        return wing_or_vehicle(dataset)
    except ValueError as error:
        raise WingfitError(f"{path} cannot be diagnosed here", str(error)) from error
