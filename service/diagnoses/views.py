"""Answers about diagnoses, from their rows."""

from __future__ import annotations

from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.service.answers import checked
from wingfit.service.diagnoses import specs
from wingfit.service.runs.views import columns
from wingfit.service.storage.tables import DiagnosisRow
from wingfit.workers.jobs import Wish


def diagnosis(row: DiagnosisRow) -> Diagnosis:
    """A diagnosis from its row."""
    wish = None if row.wish == Wish.NONE else row.wish
    spec = specs.diagnosis_settings(specs.stored(row.spec))
    return checked(Diagnosis, columns(row) | {"wish": wish, "spec": spec, "steps": row.generations})
