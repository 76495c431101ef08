"""Shapes of the server's answers about diagnoses (docs/api.md explains the fields)."""

from __future__ import annotations

from typing import Any, TypedDict

from wingfit.client.answers import Kind, State


class Diagnosis(TypedDict):
    """A diagnosis and its progress; ``verdict`` and ``summary`` when it has succeeded."""

    id: str
    name: str
    dataset_id: str
    run_id: str | None
    kind: Kind
    spec: dict[str, Any]
    state: State
    wish: str | None
    stage: str | None
    progress: float
    eta_seconds: float | None
    created_at: str
    started_at: str | None
    finished_at: str | None
    steps: int
    evaluations: int
    verdict: str | None
    summary: str | None
    error: str | None
