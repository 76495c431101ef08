"""Checks requests for diagnoses, and converts them to specifications."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.records import Dataset, SeriesDataset
from wingfit.rigs.rig import Rig
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.diagnoses.requests import DiagnosisIn
from wingfit.service.http.problems import error_item, invalid
from wingfit.service.runs import spec_views
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.request_checks import gene_names, refuse_unknown
from wingfit.service.runs.requests import VehicleModel


def checked_rig(
    body: DiagnosisIn,
    dataset: SeriesDataset,
    rig: Rig,
    diagnoser: Diagnoser,
    of_run: CalibrationSpec | None = None,
    genome: Mapping[str, float] | None = None,
) -> DiagnosisSpec:
    """Return the specification of a diagnosis of series with their simulation ``rig``; raise a 422 if it does not fit.

    ``of_run`` and ``genome`` as in :func:`checked`.
    """
    spec_views.refuse_foreign(body, dataset)
    calibration = spec_views.calibration_spec(body, of_run or CalibrationSpec())
    start = dict(genome or {})
    suspects = tuple(body.suspects)
    spec = DiagnosisSpec(calibration, start, suspects, refits=body.refits, exhaustive=body.exhaustive)
    try:
        diagnoser.check_rig(spec, dataset, rig)
    except ValueError as error:
        raise invalid("the diagnosis does not fit the dataset", [error_item("body", None, str(error))]) from None
    return spec


def checked(
    body: DiagnosisIn,
    dataset: Dataset,
    engine: Engine,
    diagnoser: Diagnoser,
    of_run: CalibrationSpec | None = None,
    genome: Mapping[str, float] | None = None,
) -> DiagnosisSpec:
    """Return the specification that the request ``body`` describes; raise a 422 if it does not fit the dataset.

    For a diagnosis of a run, ``of_run`` is the run's specification, which applies where ``body`` has no setting, and
    ``genome`` (gene name to value) its best genome, from which to start; genes not in the requested model are ignored.
    """
    spec_views.refuse_foreign(body, dataset)
    base = of_run or CalibrationSpec()
    calibration = replace(spec_views.calibration_spec(body, base), axes=base.axes)
    spec_views.refuse_cutoff(calibration.low_pass, dataset.recordings)
    vehicle = VehicleModel.model_validate({"preset": calibration.preset, "without": list(calibration.without)})
    spec_views.refuse_effects(calibration.effects, dataset, vehicle)
    known = gene_names(engine, calibration, dataset)
    refuse_unknown(calibration, dataset, known)
    for name, value in calibration.fixed.items():
        try:
            engine.genome(calibration, dataset, {name: value})
        except ValueError as error:
            raise invalid("a value is out of bounds", [error_item(f"body.fixed.{name}", value, str(error))]) from None
    start = {name: value for name, value in (genome or {}).items() if name in known}
    spec = DiagnosisSpec(
        calibration=calibration,
        start=start,
        suspects=tuple(body.suspects),
        refine=body.refine,
        refits=body.refits,
        exhaustive=body.exhaustive,
        axes=tuple(body.axes or ()),
    )
    try:
        diagnoser.check(spec, dataset)
    except ValueError as error:
        raise invalid("the diagnosis does not fit the dataset", [error_item("body", None, str(error))]) from None
    return spec
