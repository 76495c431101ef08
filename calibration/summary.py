"""Summarises a calibration, on tracks, forces or series, from its last checkpoint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.estimation import summarise_forces
from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.preparation import Prepared
from wingfit.calibration.result import Result, judge
from wingfit.calibration.search import found, found_of
from wingfit.calibration.series.judge import judge_series
from wingfit.calibration.series.result import SeriesResult
from wingfit.calibration.spec import CalibrationSpec
from wingfit.calibration.starts import doubts
from wingfit.records import Dataset, SeriesDataset
from wingfit.records.blas_threads import one_blas_thread
from wingfit.rigs.rig import Rig


@one_blas_thread
def summarise(
    spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any]
) -> Result | ForceResult:
    """Compare the result in the last ``checkpoint`` with every recording of ``dataset``, held-out ones included.

    Its remarks begin with those on the search.
    """
    if dataset.kind == "forces":
        forces = summarise_forces(spec, dataset, evaluator, checkpoint)
        return replace(forces, remarks=(*doubts(checkpoint), *forces.remarks))
    (*_, genome) = found(spec, dataset, checkpoint).values()
    tracks = judge(spec, dataset, evaluator, genome)
    return replace(tracks, remarks=(*doubts(checkpoint), *tracks.remarks))


@one_blas_thread
def summarise_rig(
    ready: Prepared, rig: Rig, dataset: SeriesDataset, evaluator: Evaluator, checkpoint: dict[str, Any]
) -> SeriesResult:
    """Compare the result in the last ``checkpoint`` with every recording of ``dataset``, held-out ones included.

    ``ready``: the calibration of ``rig`` (:func:`wingfit.calibration.preparation.prepare_rig`). The remarks begin with
    those on the search.
    """
    (genome,) = found_of(ready.spec, checkpoint).values()
    series = judge_series(ready, rig, dataset, evaluator, genome)
    return replace(series, remarks=(*doubts(checkpoint), *series.remarks))
