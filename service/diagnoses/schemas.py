"""Diagnoses on the wire."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StrictBool
from pydantic_core import PydanticCustomError

from wingfit.service.outcomes.load_schemas import Number
from wingfit.service.runs.schemas import Kind
from wingfit.service.runs.spec_schemas import (
    DATASET_ID,
    LARGEST_SEED,
    Accuracy,
    Axes,
    Division,
    Effects,
    ForceAxis,
    Name,
    Title,
    VehicleModel,
    Whole,
)
from wingfit.workers.jobs import State

Verdict = Literal["adequate", "named", "ambiguous", "unnamed", "measurement fault"]
MOST_REFITS = 50


def _once(names: list[str]) -> list[str]:
    for name in names:
        if names.count(name) > 1:
            raise PydanticCustomError("repeated", "must name each once; {name} is there twice", {"name": name})
    return names


Values = Annotated[dict[str, Number], Field(max_length=1000)]


class DiagnosisSettings(VehicleModel, BaseModel):
    """The nominal model, what it is fitted to, and what it may lack; see `wingfit.diagnosis.DiagnosisSpec`."""

    division: Division = "11"
    seed: Annotated[Whole, Field(ge=0, le=LARGEST_SEED)] = 1
    bounds_factor: Annotated[Number, Field(ge=1.01, le=100)] = 5.0
    accuracy_mm: Accuracy = 0.1
    recordings: Annotated[list[Name], Field(max_length=1000, description="empty: all that are not held out")] = []
    genes: Annotated[
        list[Name], Field(max_length=1000, description="free genes of the nominal model; empty: all usual")
    ] = []
    fixed: Annotated[Values, Field(description="genes that keep a value")] = {}
    effects: Effects = []
    suspects: Annotated[
        list[Name],
        AfterValidator(_once),
        Field(max_length=100, description="effects to consider; empty: all of /v1/effects that fit"),
    ] = []
    refine: Annotated[StrictBool, Field(description="whether a finer division may be taken where it limits")] = True
    refits: Annotated[Whole, Field(ge=1, le=MOST_REFITS, description="effects refitted in full at most")] = 8


class DiagnosisIn(DiagnosisSettings):
    """A diagnosis to make: of a dataset, or of a run, whose settings hold where the request names none."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"dataset_id": DATASET_ID, "division": "11", "name": "what is missing?"}]},
    )

    dataset_id: Annotated[Name | None, Field(description="null: that of the run")] = None
    run_id: Annotated[Name | None, Field(description="run to start from: its best genome and its settings")] = None
    name: Title | None = None
    axes: Annotated[Axes | None, Field(description="vehicles only; null: all that every recording has")] = None


class DiagnosisSpecOut(DiagnosisSettings):
    """How a diagnosis is made; ``start`` is the genome that it begins with, empty for the dataset's estimates."""

    axes: list[ForceAxis]
    start: dict[str, float]


_OUT: dict[str, Any] = {
    "id": "dx_7d20c14be5a9f386",
    "name": "Robird campaign, division 11",
    "dataset_id": DATASET_ID,
    "run_id": None,
    "kind": "tracks",
    "spec": {"division": "11", "axes": [], "start": {}},
    "state": "RUNNING",
    "wish": None,
    "stage": "refitting with hinge offset",
    "progress": 0.62,
    "eta_seconds": 71.0,
    "created_at": "2026-11-05T09:31:00.000000Z",
    "started_at": "2026-11-05T09:31:00.120000Z",
    "finished_at": None,
    "steps": 48,
    "evaluations": 5210,
    "verdict": None,
    "summary": None,
    "error": None,
}


class DiagnosisOut(BaseModel):
    """A diagnosis; ``wish`` is a cancellation that takes effect within seconds."""

    model_config = ConfigDict(json_schema_extra={"examples": [_OUT]})

    id: str
    name: str
    dataset_id: str
    run_id: str | None
    kind: Kind
    spec: DiagnosisSpecOut
    state: State
    wish: Literal["CANCEL"] | None
    stage: str | None
    progress: float
    eta_seconds: float | None
    created_at: str
    started_at: str | None
    finished_at: str | None
    steps: int
    evaluations: int
    verdict: Verdict | None
    summary: str | None
    error: str | None


class StepEvent(BaseModel):
    """The data of a ``step`` event; ``elapsed_seconds`` counts from the last start."""

    sequence: int
    stage: str
    progress: float
    evaluations: int
    elapsed_seconds: float
    eta_seconds: float | None
