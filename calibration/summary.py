"""Summarises a calibration, on tracks or on forces, from its last checkpoint."""

from __future__ import annotations

from typing import Any

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.estimation import summarise_forces
from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.result import Result, judge
from wingfit.calibration.search import found
from wingfit.calibration.spec import CalibrationSpec
from wingfit.records import Dataset
from wingfit.records.blas_threads import one_blas_thread


@one_blas_thread
def summarise(
    spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any]
) -> Result | ForceResult:
    """Compare the result in the last ``checkpoint`` with every recording of ``dataset``, held-out ones included."""
    if dataset.kind == "forces":
        return summarise_forces(spec, dataset, evaluator, checkpoint)
    (*_, genome) = found(spec, dataset, checkpoint).values()
    return judge(spec, dataset, evaluator, genome)
