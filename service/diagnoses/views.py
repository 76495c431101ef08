"""Diagnoses from rows to the wire."""

from __future__ import annotations

from wingfit.service.diagnoses import specs
from wingfit.service.diagnoses.schemas import DiagnosisOut, StepEvent
from wingfit.service.runs.views import columns
from wingfit.service.storage.tables import DiagnosisRow, StepRow
from wingfit.workers.jobs import Wish


def diagnosis(row: DiagnosisRow) -> DiagnosisOut:
    """A diagnosis."""
    wish = None if row.wish == Wish.NONE else row.wish
    spec = specs.out(specs.stored(row.spec))
    return DiagnosisOut.model_validate(columns(row) | {"wish": wish, "spec": spec, "steps": row.generations})


def step(row: StepRow) -> StepEvent:
    """A step as an event."""
    return StepEvent.model_validate(columns(row))
