"""Calibrated models to export: a diagnosed vehicle with the effects that were found, and a calibrated wing."""

from __future__ import annotations

from dataclasses import replace

import wingfit
from benchmarks.common.files import EXAMPLES
from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.problem import base_genome
from wingfit.calibration.result import Result
from wingfit.calibration.spec import CalibrationSpec, wing_model
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.export.calibrated_model import CalibratedModel, Provenance
from wingfit.export.from_finding import of_finding
from wingfit.export.from_run import of_forces, of_tracks
from wingfit.records import Dataset, load_dataset, wing_or_vehicle
from wingfit.service.outcomes import force_views
from wingfit.service.runs import views

SOURCE = Provenance("run", "benchmark", "", "", "", "", "", 1, "", "")
SUSPECTS = ("clap_and_peel", "varying_coefficients", "circulation_lag")


def diagnosed_vehicle() -> CalibratedModel:
    """Diagnose examples/delfly without clap and peel, with a few suspects; return the model with what was named."""
    dataset = wing_or_vehicle(load_dataset(EXAMPLES / "delfly"))
    spec = CalibrationSpec(without=("clap_and_peel",))
    finding = wingfit.diagnose(dataset, DiagnosisSpec(spec, suspects=SUSPECTS))
    return of_finding(spec, dataset, finding, None, replace(SOURCE, origin="diagnosis"))


def calibrated_vehicle(dataset: Dataset, spec: CalibrationSpec | None = None) -> CalibratedModel:
    """Calibrate a vehicle and return the model as it is exported."""
    settings = spec or CalibrationSpec()
    found = wingfit.calibrate(dataset, settings)
    if not isinstance(found, ForceResult):
        raise TypeError("a vehicle has a result on forces")
    stored = force_views.result(found, settings, dataset)
    law = stored["global_model"]
    return of_forces(settings, dataset, stored, law and force_views.law(law, dataset), SOURCE)


def calibrated_wing(dataset: Dataset, spec: CalibrationSpec) -> CalibratedModel:
    """Calibrate a wing and return the model as it is exported."""
    found = wingfit.calibrate(dataset, spec)
    if not isinstance(found, Result):
        raise TypeError("a wing has a result on tracks")
    stored = views.result(found)
    genome = base_genome(wing_model(dataset, spec), {one.name: one.best for one in found.genes}).as_dict()
    return of_tracks(spec, dataset, genome, stored, SOURCE)
