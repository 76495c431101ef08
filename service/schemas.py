"""What goes over the wire, with unit suffixes. Inside, everything is SI (see `service/views.py`)."""

from __future__ import annotations

import re
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue
from pydantic_core import PydanticCustomError

from service.load_schemas import ConditionIn, Number, OutputsOut, Wanted
from workers.jobs import State

LARGEST_SEED = 2**53 - 1
DIVISION = r"^[1-9][0-9]?(x[1-9][0-9]?|(,[1-9][0-9]?){0,63})$"
LONGEST_DIVISION = 200
DIVISION_FORMS = "preset 4, 11, 24; strips x bodies of each: 6x4; or bodies of each strip, root first: 3,3,3,2"
FINEST_MM, COARSEST_MM = 0.02, 1.0

Item = TypeVar("Item")
Name = Annotated[str, Field(min_length=1, max_length=200)]
Whole = Annotated[int, Field(strict=True)]


def _readable(division: str) -> str:
    if len(division) > LONGEST_DIVISION or not re.fullmatch(DIVISION, division):
        raise PydanticCustomError("division", "must be a {forms}", {"forms": DIVISION_FORMS})
    return division


Division = Annotated[
    str,
    AfterValidator(_readable),
    Field(
        json_schema_extra={"pattern": DIVISION, "maxLength": LONGEST_DIVISION},
        description=DIVISION_FORMS,
    ),
]


def _attainable(accuracy_mm: float) -> float:
    if accuracy_mm < FINEST_MM:
        raise PydanticCustomError(
            "too_fine",
            "must be at least {least} mm: below, corners in the law of the air make the estimated error unreliable",
            {"least": FINEST_MM},
        )
    if accuracy_mm > COARSEST_MM:
        raise PydanticCustomError(
            "too_coarse",
            "must be at most {most} mm: beyond, the error of the solution would be as large as what is fitted",
            {"most": COARSEST_MM},
        )
    return accuracy_mm


Accuracy = Annotated[
    Number,
    AfterValidator(_attainable),
    Field(
        json_schema_extra={"minimum": FINEST_MM, "maximum": COARSEST_MM},
        description="largest error of any simulated marker at any instant; the steps of a beat follow from it",
    ),
]

_RECORDING: dict[str, Any] = {
    "name": "vacuum-3hz-0deg",
    "rig": "vacuum_chamber",
    "held_out": False,
    "frames": 90,
    "markers": 40,
    "missing_percent": 4.2,
    "flap_frequency_hz": 3.0,
    "phase_lag_deg": 0.0,
    "pressure_mbar": 10.0,
    "temperature_c": 20.0,
    "airspeed_m_s": 0.0,
    "angle_of_attack_deg": 0.0,
}
_DATASET: dict[str, Any] = {
    "id": "ds_0f3c9a7be1d24568",
    "name": "Robird campaign",
    "description": "Left wing, vacuum chamber and wind tunnel",
    "created_at": "2026-11-05T09:30:00.000000Z",
    "sha256": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    "size_bytes": 1482003,
    "markers": 49,
    "recordings": [_RECORDING],
}
_SPEC: dict[str, Any] = {
    "division": "11",
    "mode": "staged",
    "population": 50,
    "stall": 10,
    "tolerance": 0.001,
    "max_generations": 200,
    "seed": 1,
    "bounds_factor": 5.0,
    "accuracy_mm": 0.1,
    "recordings": [],
    "genes": [],
}
_RUN: dict[str, Any] = {
    "id": "run_5c1e07a94bd83f26",
    "name": "first try",
    "dataset_id": _DATASET["id"],
    "spec": _SPEC,
    "state": "RUNNING",
    "wish": None,
    "stage": "structural",
    "progress": 0.31,
    "eta_seconds": 84.0,
    "created_at": "2026-11-05T09:31:00.000000Z",
    "started_at": "2026-11-05T09:31:00.120000Z",
    "finished_at": None,
    "generations": 12,
    "evaluations": 600,
    "best_mm": 1.84,
    "error": None,
}


def _example(value: dict[str, Any]) -> ConfigDict:
    return ConfigDict(json_schema_extra={"examples": [value]})


class Page(BaseModel, Generic[Item]):
    """One page of a list; ``next_cursor`` asks for the next, null on the last."""

    items: list[Item]
    next_cursor: str | None


class ErrorOut(BaseModel):
    """Where an input is wrong."""

    where: str
    value: JsonValue
    message: str


class ProblemOut(BaseModel):
    """Problem details (RFC 9457)."""

    model_config = _example(
        {
            "type": "urn:wingfit:problem:invalid",
            "title": "Unprocessable Entity",
            "status": 422,
            "detail": "the request is invalid",
            "errors": [{"where": "body.seed", "value": -1, "message": "Input should be greater than or equal to 0"}],
        }
    )

    type: str
    title: str
    status: int
    detail: str
    state: State | None = None
    errors: list[ErrorOut] = []


class HealthOut(BaseModel):
    """Standing of the service; ``detail`` says what is wrong when it is degraded."""

    status: Literal["starting", "ok", "degraded"]
    version: str
    sqlite_version: str
    evaluator: str
    workers: int | None
    runs_active: int
    detail: str | None = None


class RecordingOut(BaseModel):
    """One recording and its condition."""

    name: str
    rig: str
    held_out: bool
    frames: int
    markers: int
    missing_percent: float
    flap_frequency_hz: float
    phase_lag_deg: float
    pressure_mbar: float
    temperature_c: float
    airspeed_m_s: float
    angle_of_attack_deg: float


class DatasetOut(BaseModel):
    """An uploaded dataset."""

    model_config = _example(_DATASET)

    id: str
    name: str
    description: str
    created_at: str
    sha256: str
    size_bytes: int
    markers: int
    recordings: list[RecordingOut]


class SpecOut(BaseModel):
    """How a run calibrates; see `calibration.search.CalibrationSpec`."""

    division: Division = "11"
    mode: Literal["staged", "joint"] = "staged"
    population: Annotated[Whole, Field(ge=4, le=1000)] = 50
    stall: Annotated[Whole, Field(ge=1, le=1000)] = 10
    tolerance: Annotated[Number, Field(ge=0, le=1)] = 1e-3
    max_generations: Annotated[Whole, Field(ge=1, le=10_000, description="per stage")] = 200
    seed: Annotated[Whole, Field(ge=0, le=LARGEST_SEED)] = 1
    bounds_factor: Annotated[Number, Field(ge=1.01, le=100)] = 5.0
    accuracy_mm: Accuracy = 0.1
    recordings: Annotated[list[Name], Field(max_length=1000, description="empty: all that are not held out")] = []
    genes: Annotated[list[Name], Field(max_length=1000, description="empty: all")] = []


class RunIn(SpecOut):
    """A calibration to run."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"dataset_id": _DATASET["id"], "division": "11", "name": "first try"}]},
    )

    dataset_id: Name
    name: Name | None = None


class RunOut(BaseModel):
    """A run; ``wish`` is a pause or cancellation that takes effect with the generation under way."""

    model_config = _example(_RUN)

    id: str
    name: str
    dataset_id: str
    spec: SpecOut
    state: State
    wish: Literal["PAUSE", "CANCEL"] | None
    stage: str | None
    progress: float
    eta_seconds: float | None
    created_at: str
    started_at: str | None
    finished_at: str | None
    generations: int
    evaluations: int
    best_mm: float | None
    error: str | None


class HistoryItem(BaseModel):
    """One finished generation; fitness in m^2."""

    sequence: int
    stage: str
    generation: int
    best: float | None
    mean: float | None
    diversity: float | None
    best_mm: float | None
    evaluations: int
    failed: int
    reasons: list[str]
    elapsed_seconds: float


class GenerationEvent(HistoryItem):
    """The data of a ``generation`` event."""

    progress: float
    eta_seconds: float | None


class GeneOut(BaseModel):
    """One gene, in its ``unit``; shares are normalised."""

    name: str
    unit: str
    description: str
    nominal: float
    best: float
    lower: float
    upper: float
    searched: bool
    standard_error_percent: float | None
    identifiable: bool | None


class GenomeOut(BaseModel):
    """Best genome so far; ``final`` when the run has succeeded."""

    genes: list[GeneOut]
    final: bool


class RecordingResultOut(BaseModel):
    """Mean distance per marker on one recording, nominal and calibrated."""

    name: str
    held_out: bool
    stage: str | None
    samples: int
    before_mm: float | None
    after_mm: float | None


class ResultOut(BaseModel):
    """Outcome of a calibration; means over recordings weighted by samples."""

    before_mm: float | None
    after_mm: float | None
    held_out_before_mm: float | None
    held_out_after_mm: float | None
    noise_mm: float | None
    remarks: list[str]
    recordings: list[RecordingResultOut]
    genes: list[GeneOut]


Point = Annotated[list[float | None], Field(min_length=3, max_length=3)]


class NumericsOut(BaseModel):
    """How a simulation was solved: the largest error of a marker that was asked for and the estimated one.

    ``beats`` were simulated on the way to the periodic one, with at most ``steps_per_beat`` each.
    """

    accuracy_mm: float
    estimated_error_mm: float | None
    steps_per_beat: int
    beats: int


class ComparisonOut(BaseModel):
    """Recorded and simulated tracks, [time][marker][x, y, z] in mm; null where not recorded."""

    recording: str
    phase: list[float]
    markers: list[str]
    recorded_mm: list[list[Point]]
    simulated_mm: list[list[Point]]
    numerics: NumericsOut


class SimulationIn(BaseModel):
    """A simulation of one recording's condition; genes not named keep their nominal value."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "dataset_id": _DATASET["id"],
                    "recording": _RECORDING["name"],
                    "division": "4",
                    "genome": {"E_f": 7e6},
                    "outputs": ["motors", "averages"],
                }
            ]
        },
    )

    dataset_id: Name
    recording: Name
    division: Division = "11"
    genome: Annotated[dict[str, Number], Field(max_length=1000)] = {}
    accuracy_mm: Accuracy = 0.1
    outputs: Wanted = False


class LoadsIn(SimulationIn):
    """A simulation for its loads alone, under the recording's condition or one that differs from it."""

    model_config = _example(
        {
            "dataset_id": _DATASET["id"],
            "recording": _RECORDING["name"],
            "condition": {"flap_frequency_hz": 5.0, "airspeed_m_s": 4.0},
            "outputs": ["motors", "averages"],
        }
    )

    condition: ConditionIn = ConditionIn()
    outputs: Wanted = True


class SimulationOut(ComparisonOut):
    """Tracks and their mean distance per marker; loads where they were asked for."""

    mean_distance_mm: float | None
    outputs: OutputsOut | None = None
