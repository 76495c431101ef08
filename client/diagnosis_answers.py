"""JSON answers of the server about diagnoses."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict

from wingfit.client.answers import Job, JobSpec

Verdict = Literal["adequate", "named", "ambiguous", "unnamed", "measurement fault"]


class DiagnosisSpec(JobSpec):
    """The settings of a diagnosis; ``start`` is its initial genome, empty for the dataset's estimates."""

    fixed: dict[str, float]
    suspects: list[str]
    refine: bool
    refits: int
    start: dict[str, float]


class Diagnosis(Job):
    """A diagnosis; ``pending_action`` is a cancellation that takes effect within seconds.

    ``verdict`` and ``summary`` are null until it has succeeded.
    """

    run_id: str | None
    spec: DiagnosisSpec
    pending_action: Literal["CANCEL"] | None
    steps: int
    verdict: Verdict | None
    summary: str | None


class StepEvent(TypedDict):
    """The data of the server-sent event ``step``; ``elapsed_seconds`` counts from the last start of the diagnosis."""

    sequence: int
    stage: str
    progress: float
    evaluations: int
    elapsed_seconds: float
    eta_seconds: float | None
