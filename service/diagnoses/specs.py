"""Specifications of diagnoses: from requests, from the database, and in answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydantic import TypeAdapter

from wingfit.calibration.spec import CalibrationSpec
from wingfit.client import diagnosis_answers as answers
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.service.answers import answer
from wingfit.service.diagnoses.requests import DiagnosisIn
from wingfit.service.runs.spec_views import calibration_spec
from wingfit.service.units import tidy_mm

_SPEC = TypeAdapter(DiagnosisSpec)


def nominal_model(body: DiagnosisIn, of_run: CalibrationSpec | None) -> CalibrationSpec:
    """The model that a request gives: by its own settings, else those of the run, else the defaults."""
    base = of_run or CalibrationSpec()
    return replace(calibration_spec(body, base), axes=base.axes)


def diagnosis_spec(body: DiagnosisIn, model: CalibrationSpec, start: Mapping[str, float]) -> DiagnosisSpec:
    """The diagnosis that a request gives, of ``model``, from the genome ``start``."""
    return DiagnosisSpec(
        calibration=model,
        start=dict(start),
        suspects=tuple(body.suspects),
        refine=body.refine,
        refits=body.refits,
        axes=tuple(body.axes or ()),
    )


def stored(values: dict[str, Any]) -> DiagnosisSpec:
    """A specification from its JSON form."""
    return _SPEC.validate_python(values)


def diagnosis_settings(spec: DiagnosisSpec) -> answers.DiagnosisSpec:
    """The settings of a diagnosis as answers give them."""
    return answer(
        answers.DiagnosisSpec,
        spec.calibration,
        accuracy_mm=tidy_mm(spec.calibration.accuracy),
        start=dict(spec.start),
        suspects=list(spec.suspects),
        refine=spec.refine,
        refits=spec.refits,
        axes=list(spec.axes),
    )
