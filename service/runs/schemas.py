"""What goes over the wire, with unit suffixes. Inside, everything is SI (see `service/runs/views.py`)."""

from __future__ import annotations

from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, JsonValue

from wingfit.service.outcomes.load_schemas import ConditionIn, Number, OutputsOut, Wanted
from wingfit.service.runs.spec_schemas import DATASET_ID, SPEC, Accuracy, Division, Effects, Name, SpecOut, VehicleModel
from wingfit.workers.jobs import State

Kind = Literal["tracks", "forces"]

Item = TypeVar("Item")

_RECORDING: dict[str, Any] = {
    "name": "vacuum-3hz-0deg",
    "rig": "vacuum_chamber",
    "held_out": False,
    "frames": 90,
    "markers": 40,
    "channels": [],
    "missing_percent": 4.2,
    "flap_frequency_hz": 3.0,
    "phase_lag_deg": 0.0,
    "pressure_mbar": 10.0,
    "temperature_c": 20.0,
    "airspeed_m_s": 0.0,
    "angle_of_attack_deg": 0.0,
}
_DATASET: dict[str, Any] = {
    "id": DATASET_ID,
    "name": "Robird campaign",
    "kind": "tracks",
    "description": "Left wing, vacuum chamber and wind tunnel",
    "created_at": "2026-11-05T09:30:00.000000Z",
    "sha256": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    "size_bytes": 1482003,
    "markers": 49,
    "recordings": [_RECORDING],
}
_RUN: dict[str, Any] = {
    "id": "run_5c1e07a94bd83f26",
    "name": "first try",
    "dataset_id": _DATASET["id"],
    "kind": "tracks",
    "spec": SPEC,
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
    "best_mn": None,
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
    """Standing of the service; ``detail`` says what is wrong when it is degraded.

    The numbers of jobs that have not ended are null where the database does not answer.
    """

    status: Literal["starting", "ok", "degraded"]
    version: str
    sqlite_version: str
    evaluator: str
    workers: int | None
    runs_active: int | None
    diagnoses_active: int | None
    detail: str | None = None


class RecordingOut(BaseModel):
    """One recording and its condition; ``channels`` are those of forces, ``markers`` those tracked."""

    name: str
    rig: str
    held_out: bool
    frames: int
    markers: int
    channels: list[str]
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
    kind: Kind
    description: str
    created_at: str
    sha256: str
    size_bytes: int
    markers: int
    recordings: list[RecordingOut]


class RunOut(BaseModel):
    """A run; ``wish`` is a pause or cancellation that takes effect with the generation under way.

    ``best_mm`` is a mean distance per marker, of tracks; ``best_mn`` an RMS difference, of forces; the other is null.
    """

    model_config = _example(_RUN)

    id: str
    name: str
    dataset_id: str
    kind: Kind
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
    best_mn: float | None
    error: str | None


class HistoryItem(BaseModel):
    """One finished generation; fitness in m^2 or N^2."""

    sequence: int
    stage: str
    generation: int
    best: float | None
    mean: float | None
    diversity: float | None
    best_mm: float | None
    best_mn: float | None
    evaluations: int
    failed: int
    reasons: list[str]
    elapsed_seconds: float


class GenerationEvent(HistoryItem):
    """The data of a ``generation`` event."""

    progress: float
    eta_seconds: float | None


class CheckedOut(BaseModel):
    """A run as it would be submitted: its name, and its specification with everything decided."""

    name: str
    spec: SpecOut


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
    standard_error: float | None = None


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
    """Outcome of a calibration on tracks; means over recordings weighted by samples."""

    kind: Literal["tracks"]
    before_mm: float | None
    after_mm: float | None
    held_out_before_mm: float | None
    held_out_after_mm: float | None
    noise_mm: float | None
    remarks: list[str]
    recordings: list[RecordingResultOut]
    genes: list[GeneOut]


MOST_COORDINATES = 1_000_000  # recorded ones in one answer
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
    """Recorded and simulated tracks, [time][marker][x, y, z] in mm; null where not recorded.

    ``every``: one of how many instants is here; 1, but for recordings that are too long for one answer.
    """

    recording: str
    phase: list[float]
    markers: list[str]
    recorded_mm: list[list[Point]]
    simulated_mm: list[list[Point]]
    every: int
    numerics: NumericsOut


class WingIn(BaseModel):
    """What to simulate a wing of; genes not named keep their nominal value."""

    model_config = ConfigDict(extra="forbid")

    dataset_id: Name
    recording: Name
    division: Division = "11"
    genome: Annotated[dict[str, Number], Field(max_length=1000)] = {}
    effects: Effects = []
    accuracy_mm: Accuracy = 0.1
    outputs: Wanted = False


class SimulationIn(VehicleModel, WingIn):
    """A simulation of one recording's condition; genes not named keep their nominal value."""

    model_config = _example(
        {
            "dataset_id": DATASET_ID,
            "recording": _RECORDING["name"],
            "division": "4",
            "genome": {"E_f": 7e6},
            "outputs": ["motors", "averages"],
        }
    )


class LoadsIn(WingIn):
    """A simulation for its loads alone, under the recording's condition or one that differs from it."""

    model_config = _example(
        {
            "dataset_id": DATASET_ID,
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
