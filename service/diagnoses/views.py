"""Answers about diagnoses, from their rows."""

from __future__ import annotations

from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.service.diagnoses import specs
from wingfit.service.runs.views import columns, job_of
from wingfit.service.storage.tables import DiagnosisRow


def diagnosis(row: DiagnosisRow) -> Diagnosis:
    """A diagnosis from its row."""
    return job_of(Diagnosis, columns(row), specs.diagnosis_settings(specs.stored(row.spec)))
