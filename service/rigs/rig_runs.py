"""Calibrations of rigs of the user's own: the checks of a request, the search, and the result as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.preparation import Prepared, prepare_rig
from wingfit.calibration.problem import base_genome
from wingfit.calibration.result import GeneResult
from wingfit.calibration.search import CalibrationSpec, Generation, calibrate_prepared
from wingfit.calibration.series.result import SeriesResult
from wingfit.calibration.summary import summarise_rig
from wingfit.client import series_answers as a
from wingfit.records import SeriesDataset
from wingfit.rigs.rig import Rig
from wingfit.service.answers import answer
from wingfit.service.runs.views import correlations, gene


def calibrate(
    spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None
) -> Iterator[Generation]:
    """Yield each finished generation; continue from ``checkpoint`` unless it is None."""
    return calibrate_prepared(prepare_rig(spec, rig, dataset), evaluator, checkpoint)


def summarise(
    spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset, evaluator: Evaluator, checkpoint: dict[str, Any]
) -> SeriesResult:
    """Evaluate the best genome of the search that ended with ``checkpoint`` on all recordings; return the result."""
    return summarise_rig(prepare_rig(spec, rig, dataset), rig, dataset, evaluator, checkpoint)


def genes(
    spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset, genome: Mapping[str, float]
) -> tuple[GeneResult, ...]:
    """Return all genes with nominal value, bounds, and their value in ``genome``, before the search has ended."""
    ready: Prepared = prepare_rig(spec, rig, dataset)
    nominal = base_genome(ready.model)
    return tuple(
        GeneResult(
            one.name, one.unit, one.description, nominal[one.name], genome[one.name], one.lower, one.upper,
            one.name in ready.searched, None, None,
        )
        for one in ready.model.genes
    )  # fmt: skip


def result(outcome: SeriesResult) -> a.SeriesResult:
    """Return the JSON answer with the result of a calibration."""
    genes = [gene(one) for one in outcome.genes]
    return answer(
        a.SeriesResult,
        outcome,
        kind="series",
        genes=genes,
        correlations=correlations(outcome.correlations),
        curves=[answer(a.Curve, one, time_s=list(one.time)) for one in outcome.curves],
    )
