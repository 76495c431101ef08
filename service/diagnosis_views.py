"""Diagnoses from rows to the wire."""

from __future__ import annotations

from service import diagnosis_specs
from service.diagnosis_schemas import DiagnosisOut, StepEvent
from service.tables import DiagnosisRow, StepRow
from service.views import columns
from workers.jobs import Wish


def diagnosis(row: DiagnosisRow) -> DiagnosisOut:
    """A diagnosis."""
    wish = None if row.wish == Wish.NONE else row.wish
    spec = diagnosis_specs.out(diagnosis_specs.stored(row.spec))
    return DiagnosisOut.model_validate(columns(row) | {"wish": wish, "spec": spec, "steps": row.generations})


def step(row: StepRow) -> StepEvent:
    """A step as an event."""
    return StepEvent.model_validate(columns(row))
