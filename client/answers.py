"""The answers of the server: one definition, which the server publishes (OpenAPI) and the Python client hands out.

Names of fields end in their unit. ``docs/api.md`` explains the resources. Answers about forces, loads, effects,
diagnoses and keys are in the other ``*_answers.py`` of this folder.
"""

from __future__ import annotations

from typing import Annotated, Any, Generic, Literal, NotRequired, TypeVar

from annotated_types import Len
from typing_extensions import TypedDict

from wingfit.client.load_answers import Outputs

State = Literal["QUEUED", "RUNNING", "PAUSED", "SUCCEEDED", "FAILED", "CANCELLED"]
Kind = Literal["tracks", "forces"]
FINAL: frozenset[str] = frozenset({"SUCCEEDED", "FAILED", "CANCELLED"})
Point = Annotated[list[float | None], Len(3, 3)]
Item = TypeVar("Item")

CONDITION = (
    "flap_frequency_hz",
    "phase_lag_deg",
    "pressure_mbar",
    "temperature_c",
    "airspeed_m_s",
    "angle_of_attack_deg",
)


class Page(TypedDict, Generic[Item]):
    """One page of a list; ``next_cursor`` requests the next page and is null on the last."""

    items: list[Item]
    next_cursor: str | None


class ErrorItem(TypedDict):
    """One faulty input: its place in the request, its value, and what is wrong with it."""

    where: str
    value: Any
    message: str


class Problem(TypedDict):
    """Problem details (RFC 9457); ``state`` is that of the job to which a conflict refers."""

    type: str
    title: str
    status: int
    detail: str
    state: NotRequired[State]
    errors: NotRequired[list[ErrorItem]]


class Health(TypedDict):
    """Status of the service; ``detail`` gives the cause when it is degraded.

    The numbers of jobs that have not ended are null where the database does not answer.
    """

    status: Literal["starting", "ok", "degraded"]
    version: str
    sqlite_version: str
    evaluator: str
    workers: int | None
    runs_active: int | None
    diagnoses_active: int | None
    detail: str | None


class RecordingInfo(TypedDict):
    """One recording and its condition: ``markers`` counts tracked markers, ``channels`` names the force channels."""

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


class Dataset(TypedDict):
    """An uploaded dataset."""

    id: str
    name: str
    kind: Kind
    description: str
    created_at: str
    sha256: str
    size_bytes: int
    markers: int
    recordings: list[RecordingInfo]


class JobSpec(TypedDict):
    """The settings that runs and diagnoses share, with every default filled in."""

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
    effects: list[str]
    axes: list[Literal["x", "z"]]


class RunSpec(JobSpec):
    """The settings of a run."""

    population: int
    stall: int
    tolerance: float
    max_generations: int
    finish: bool
    mode: Literal["staged", "joint", "local"]
    method: Literal["genetic", "cma_es", "gauss_newton"]


class Checked(TypedDict):
    """A run as it would be submitted: its name and its settings."""

    name: str
    spec: RunSpec


class Job(TypedDict):
    """The fields that runs and diagnoses share."""

    id: str
    name: str
    dataset_id: str
    kind: Kind
    state: State
    stage: str | None
    progress: float
    eta_seconds: float | None
    created_at: str
    started_at: str | None
    finished_at: str | None
    evaluations: int
    error: str | None


class Run(Job):
    """A calibration; ``pending_action`` is a pause or cancellation that takes effect after the current generation.

    ``best_mm`` (tracks) is the mean distance per marker, ``best_mn`` (forces) the RMS difference; the other is null.
    """

    spec: RunSpec
    pending_action: Literal["PAUSE", "CANCEL"] | None
    generations: int
    best_mm: float | None
    best_mn: float | None


class HistoryItem(TypedDict):
    """One finished generation; ``best`` and ``mean`` are sums of squared differences to the recordings, m^2 or N^2.

    ``diversity`` is the mean over genes of the population's standard deviation, bounds scaled to [0, 1].
    ``evaluations`` counts simulated individuals since the start of the run, ``failed`` those of this generation that
    could not be simulated, with up to ten ``reasons``.
    """

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
    """The data of the server-sent event ``generation``: the generation, and the progress of the whole run in [0, 1]."""

    progress: float
    eta_seconds: float | None


class GeneInfo(TypedDict):
    """One gene, nominal and best, with its bounds; ``identifiable`` says whether the data determine it.

    Values and ``standard_error`` are in ``unit``; genes that are shares of a whole are normalised to sum to one.
    """

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
    standard_error: NotRequired[float | None]


class GenomeInfo(TypedDict):
    """The best genome so far; ``final`` when the run has succeeded."""

    genes: list[GeneInfo]
    final: bool


class RecordingResult(TypedDict):
    """Mean distance per marker on one recording, with the nominal and with the best genome."""

    name: str
    held_out: bool
    stage: str | None
    samples: int
    before_mm: float | None
    after_mm: float | None


class Result(TypedDict):
    """Result of a calibration on tracks; means over recordings are weighted by samples."""

    kind: Literal["tracks"]
    before_mm: float | None
    after_mm: float | None
    held_out_before_mm: float | None
    held_out_after_mm: float | None
    noise_mm: float | None
    remarks: list[str]
    recordings: list[RecordingResult]
    genes: list[GeneInfo]


class Numerics(TypedDict):
    """Accuracy and cost of a simulation: the largest position error of any marker, as requested and as estimated.

    ``beats`` were simulated until the motion was periodic, with at most ``steps_per_beat`` steps each.
    """

    accuracy_mm: float
    estimated_error_mm: float | None
    steps_per_beat: int
    beats: int


class Comparison(TypedDict):
    """Recorded and simulated tracks, [time][marker][x, y, z] in mm; null where not recorded.

    The answer contains every ``stride``-th instant: all, except of recordings that are too long for one answer.
    """

    recording: str
    phase: list[float]
    markers: list[str]
    recorded_mm: list[list[Point]]
    simulated_mm: list[list[Point]]
    stride: int
    numerics: Numerics


class Simulation(Comparison):
    """Tracks, their mean distance per marker, and the loads that were requested."""

    mean_distance_mm: float | None
    outputs: NotRequired[Outputs]


class Event(TypedDict):
    """A server-sent event: ``generation`` or ``step`` (with the progress) or ``state`` (the job)."""

    id: str | None
    event: str
    data: dict[str, Any]
