"""Shapes of the server's answers, as the Python client hands them out (docs/api.md explains the fields)."""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict

State = Literal["QUEUED", "RUNNING", "PAUSED", "SUCCEEDED", "FAILED", "CANCELLED"]
Kind = Literal["tracks", "forces"]
FINAL: frozenset[str] = frozenset({"SUCCEEDED", "FAILED", "CANCELLED"})

CONDITION = (
    "flap_frequency_hz",
    "phase_lag_deg",
    "pressure_mbar",
    "temperature_c",
    "airspeed_m_s",
    "angle_of_attack_deg",
)


class Health(TypedDict):
    """Answer of ``GET /v1/health``; the numbers of active jobs are None where the database does not answer."""

    status: str
    version: str
    sqlite_version: str
    evaluator: str
    workers: int | None
    runs_active: int | None
    diagnoses_active: int | None


class RecordingInfo(TypedDict):
    """One recording of a dataset: its condition, and the markers tracked or the channels of forces."""

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


class Checked(TypedDict):
    """A run as it would be submitted."""

    name: str
    spec: dict[str, Any]


class Run(TypedDict):
    """A calibration run and how far it is."""

    id: str
    name: str
    dataset_id: str
    kind: Kind
    spec: dict[str, Any]
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


class HistoryItem(TypedDict):
    """One generation; ``best`` and ``mean`` are Eq. 14 in m^2 or N^2.

    ``best_mm`` is the mean distance per marker of tracks, ``best_mn`` the RMS difference of forces; the other is None.

    ``evaluations`` counts since the run began, ``failed`` in this generation, with up to ten of their ``reasons``.
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


class GeneInfo(TypedDict):
    """One gene, nominal and best, with its bounds and whether the data can tell it; ``standard_error`` in ``unit``."""

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
    standard_error: float | None


class GenomeInfo(TypedDict):
    """Best genome so far; ``final`` once the run has ended."""

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
    """Outcome of a finished run on tracks."""

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
    """How a simulation was solved; errors are the largest of any marker at any instant."""

    accuracy_mm: float
    estimated_error_mm: float | None
    steps_per_beat: int
    beats: int


class Comparison(TypedDict):
    """Recorded and simulated tracks [frame][marker][x, y, z] in mm; None where not recorded."""

    recording: str
    phase: list[float]
    markers: list[str]
    recorded_mm: list[list[list[float | None]]]
    simulated_mm: list[list[list[float | None]]]
    numerics: Numerics


class Strip(TypedDict):
    """Air on one strip."""

    name: str
    span_mm: list[float]
    lift_n: list[float]
    thrust_n: list[float]
    side_n: list[float]
    power_w: list[float]


class SectionLoad(TypedDict):
    """What the inner part of the wing exerts on the outer through a cut; vectors [phase][x, y, z]."""

    name: str
    span_mm: float
    moment_n_m: list[list[float]]
    force_n: list[list[float]]


class ConnectorLoad(TypedDict):
    """Wrench on, and motion of, the second of the bodies ``between`` relative to the first, in the first's axes."""

    name: str
    kind: Literal["root", "spanwise", "chordwise"]
    between: list[str]
    point_mm: list[float]
    moment_n_m: list[list[float]]
    force_n: list[list[float]]
    angular_velocity_rad_s: list[list[float]]
    velocity_m_s: list[list[float]]
    dissipated_w: list[float]
    stored_j: list[float]


class Averages(TypedDict):
    """Means over the beat, and the largest motor torques."""

    lift_n: float
    thrust_n: float
    side_n: float
    motor_power_w: dict[str, float]
    peak_motor_torque_n_m: dict[str, float]
    supplied_w: float
    dissipated_w: float
    to_air_w: float
    closing_error_w: float
    closing_error_percent: float
    dissipated_by_connector_w: dict[str, float]


class Solved(TypedDict):
    """How a beat was solved."""

    steps_per_beat: int
    beats: int
    estimated_error_mm: float | None


class Outputs(TypedDict, total=False):
    """Loads, powers and energies over one beat in order of ``phase``; only what was asked for is there."""

    phase: list[float]
    drive_phase: list[float]
    solved: Solved
    motor_angle_deg: dict[str, list[float]]
    motor_rate_rad_s: dict[str, list[float]]
    motor_torque_n_m: dict[str, list[float]]
    motor_power_w: dict[str, list[float]]
    lift_n: list[float]
    thrust_n: list[float]
    side_n: list[float]
    strips: list[Strip]
    sections: list[SectionLoad]
    connectors: list[ConnectorLoad]
    power_w: dict[str, list[float]]
    energy_j: dict[str, list[float]]
    averages: Averages


class Simulation(Comparison):
    """A comparison of one simulation with the recording under whose condition it ran; loads where asked for."""

    mean_distance_mm: float | None
    outputs: NotRequired[Outputs]


class Loads(TypedDict):
    """Loads under a recording's condition, or one that differs from it in what was asked."""

    recording: str
    outputs: Outputs


class Event(TypedDict):
    """A server-sent event: ``generation`` (a history item with progress) or ``state`` (a run)."""

    id: str | None
    event: str
    data: dict[str, Any]
