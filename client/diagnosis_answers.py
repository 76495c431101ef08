"""Answers about diagnoses."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict

from wingfit.client.answers import Job

Verdict = Literal["adequate", "named", "ambiguous", "unnamed", "measurement fault"]


class DiagnosisSpec(TypedDict):
    """The settings of a diagnosis; ``start`` is its initial genome, empty for the dataset's estimates."""

    preset: str
    without: list[str]
    low_pass_hz: float | None
    peel_width_beats: float
    division: str
    seed: int
    bounds_factor: float
    accuracy_mm: float
    recordings: list[str]
    genes: list[str]
    fixed: dict[str, float]
    effects: list[str]
    suspects: list[str]
    refine: bool
    refits: int
    axes: list[Literal["x", "z"]]
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
    """The data of a ``step`` event; ``elapsed_seconds`` counts from the last start."""

    sequence: int
    stage: str
    progress: float
    evaluations: int
    elapsed_seconds: float
    eta_seconds: float | None
