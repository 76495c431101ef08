"""Converts database rows of diagnoses to JSON answers and to specifications."""

from __future__ import annotations

from pydantic import TypeAdapter

from wingfit.client import diagnosis_answers as answers
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.service.answers import answer
from wingfit.service.runs.views import columns, job_of
from wingfit.service.storage.tables import DiagnosisRow
from wingfit.service.units import tidy_mm

_SPEC = TypeAdapter(DiagnosisSpec)


def diagnosis(row: DiagnosisRow) -> answers.Diagnosis:
    """Return the JSON answer that describes the diagnosis stored in ``row``."""
    return job_of(answers.Diagnosis, columns(row), diagnosis_settings(spec(row)))


def spec(row: DiagnosisRow) -> DiagnosisSpec:
    """Return the specification of the diagnosis stored in ``row``."""
    return _SPEC.validate_python(row.spec)


def diagnosis_settings(spec: DiagnosisSpec) -> answers.DiagnosisSpec:
    """Return the settings of a diagnosis as the JSON answers contain them, in the API's units."""
    return answer(
        answers.DiagnosisSpec,
        spec.calibration,
        accuracy_mm=tidy_mm(spec.calibration.accuracy),
        start=dict(spec.start),
        suspects=list(spec.suspects),
        refine=spec.refine,
        refits=spec.refits,
        exhaustive=spec.exhaustive,
        axes=list(spec.axes),
    )
