"""Types of the server's JSON answers: the server publishes them (OpenAPI), and the Python client returns such dicts.

The name of a field ends with its unit. ``docs/api.md`` explains the resources. Answers about forces, loads, effects,
diagnoses and keys are in the other ``*_answers.py`` of this folder.
"""

from __future__ import annotations

from typing import Annotated, Any, Generic, Literal, NotRequired, TypeVar

from annotated_types import Len
from typing_extensions import TypedDict

from wingfit.client.estimates.answers import Correlations, GeneCovariance
from wingfit.client.importing.questions import ImportQuestion
from wingfit.client.load_answers import Outputs

State = Literal["QUEUED", "RUNNING", "PAUSED", "SUCCEEDED", "FAILED", "CANCELLED"]
Kind = Literal["tracks", "forces", "series"]
FitBadge = Literal["good", "doubtful", "wrong"]
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
    """One page of a list; ``next_cursor``, sent as ``?cursor=``, requests the next page; null on the last page."""

    items: list[Item]
    next_cursor: str | None


class ErrorItem(TypedDict):
    """One fault of a request: ``where`` it is (a field, or a line of a file), the value there, and what is wrong."""

    where: str
    value: Any
    message: str


class Problem(TypedDict):
    """Answer to a failed request, as problem details by RFC 9457.

    ``status`` is the HTTP status, ``title`` a short name of the problem, ``detail`` an explanation. ``errors`` lists
    the faults of an invalid request. ``state`` is the job's state, if it does not allow the request (status 409).
    ``questions`` lists options that a file of a tracking system does not state.
    """

    type: str
    title: str
    status: int
    detail: str
    state: NotRequired[State]
    errors: NotRequired[list[ErrorItem]]
    questions: NotRequired[list[ImportQuestion]]


class Health(TypedDict):
    """Status of the service; ``detail``: the cause if ``status`` is "degraded", or what a "starting" service does.

    ``evaluator`` says how simulations are run: ray, processes or in_process. ``runs_active``, ``diagnoses_active`` and
    ``trackings_active`` count jobs that have not ended; they are null if the database does not answer.
    """

    status: Literal["starting", "ok", "degraded"]
    version: str
    sqlite_version: str
    evaluator: str
    workers: int | None
    runs_active: int | None
    diagnoses_active: int | None
    trackings_active: int | None
    detail: str | None


class RecordingInfo(TypedDict):
    """One recording and the condition under which it was made; ``held_out`` recordings are used for validation only.

    ``markers`` counts the tracked markers (0 for forces); ``channels`` names the recorded forces, "force_x", "force_z"
    (empty for tracks). ``missing_percent`` is the percentage of samples without a value. ``phase_lag_deg`` is the lag
    of the wing's rear driving rod; ``angle_of_attack_deg`` is that of the wing, or the body pitch of a vehicle. Of a
    rig of the user's own, ``channels`` names the recorded channels, ``frames`` counts samples, ``settings`` has the
    values that were set, in the dataset's units, and the fields of a flapping rig's condition are null.
    """

    name: str
    rig: str
    held_out: bool
    frames: int
    markers: int
    channels: list[str]
    missing_percent: float
    settings: dict[str, float]
    duration_s: float | None
    flap_frequency_hz: float | None
    phase_lag_deg: float | None
    pressure_mbar: float | None
    temperature_c: float | None
    airspeed_m_s: float | None
    angle_of_attack_deg: float | None


class QuantityInfo(TypedDict):
    """A channel, input or setting of a rig of the user's own; ``unit`` is "1" if it has none.

    ``place``: where a channel is measured, if the dataset states it.
    """

    name: str
    unit: str
    description: str
    place: NotRequired[str]


class RigInfo(TypedDict):
    """What the recordings of a rig of the user's own hold."""

    name: str
    channels: list[QuantityInfo]
    inputs: list[QuantityInfo]
    settings: list[QuantityInfo]


class DatasetWarning(TypedDict):
    """A likely mistake in a dataset that was accepted: where, the value, the expected one, the cause and the change.

    ``kind`` names what is wrong in one or two words, such as "frequency" or "air pressure".
    """

    kind: str
    where: str
    value: str
    expected: str
    cause: str
    change: str


class Dataset(TypedDict):
    """An uploaded dataset: marker tracks of a wing, forces of a vehicle, or series of a rig of the user's own.

    ``sha256`` is that of the uploaded file; ``rig`` describes the rig of series, and is null for others. ``warnings``
    are likely mistakes that the checks found at the upload; empty also for a dataset from before there were checks.
    """

    id: str
    name: str
    kind: Kind
    description: str
    created_at: str
    sha256: str
    size_bytes: int
    markers: int
    notes: str
    rig: RigInfo | None
    recordings: list[RecordingInfo]
    warnings: list[DatasetWarning]


class JobSpec(TypedDict):
    """The settings that runs and diagnoses have in common; settings that the request omitted have their defaults.

    Each setting is explained in :class:`wingfit.calibration.spec.CalibrationSpec` (there without the unit in the name).
    """

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
    """The settings of a run (a calibration), explained in :class:`wingfit.calibration.spec.CalibrationSpec`."""

    population: int
    stall: int
    tolerance: float
    max_generations: int
    search_division: str | None
    finish: bool
    mode: Literal["staged", "joint", "local"]
    method: Literal["genetic", "cma_es", "gauss_newton", "auto"]


class Checked(TypedDict):
    """A checked request for a run that was not submitted: the name and settings that the run would get."""

    name: str
    spec: RunSpec


class Job(TypedDict):
    """The fields that runs and diagnoses (jobs) have in common.

    ``stage`` names the present step, null before the first; ``progress`` lies in [0, 1]; ``eta_seconds`` estimates the
    remaining time; ``evaluations`` counts evaluated individuals (of equal ones each counts, and one is simulated);
    ``error`` says why the job failed, else null. Of a job on series, ``rig`` names the simulation, and ``driven`` says
    whether its user simulates it ('wingfit drive'), QUEUED while no driver serves it. ``fit_badge`` of a success rates
    its misfits as multiples of the noise: ``good`` up to 1.3, ``doubtful`` up to 3, else ``wrong``.
    """

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
    rig: str | None
    driven: bool
    notes: str
    residual_over_noise: float | None
    held_out_over_noise: float | None
    fit_badge: FitBadge | None


class Run(Job):
    """A calibration; ``pending_action`` is a requested pause or cancellation that has not taken effect yet, else null.

    The misfit of the best genome so far is in ``best_mm`` for tracks (mean distance per marker), in ``best_mn`` for
    forces (RMS difference of the fitted axes), and in ``best_percent`` for series (RMS difference, relative to the
    range of each channel); the other two are null.
    """

    spec: RunSpec
    pending_action: Literal["PAUSE", "CANCEL"] | None
    generations: int
    best_mm: float | None
    best_mn: float | None
    best_percent: float | None


class HistoryItem(TypedDict):
    """One finished generation of a search, or one iteration of Gauss-Newton.

    ``sequence`` counts from 1 over the run, ``generation`` from 0 within its ``stage``. ``best`` and ``mean`` (over the
    individuals that did not fail) are sums of squared differences to the recordings: m^2 (tracks) or N^2 (forces).
    ``diversity`` is the mean over genes of the population's standard deviation, with bounds scaled to [0, 1]; of a
    Gauss-Newton iteration, the largest change of a gene on that scale.
    ``evaluations`` counts the individuals evaluated since the start of the run (of equal ones each counts, and one is
    simulated), ``failed`` those of this generation that could not be simulated and, with the method auto, starts that
    failed since the last generation; ``reasons`` lists up to ten different causes. ``elapsed_seconds`` is the computing
    time since the start of the run, without pauses.
    """

    sequence: int
    stage: str
    generation: int
    best: float | None
    mean: float | None
    diversity: float | None
    best_mm: float | None
    best_mn: float | None
    best_percent: float | None
    evaluations: int
    failed: int
    reasons: list[str]
    elapsed_seconds: float


class GenerationEvent(HistoryItem):
    """The data of the server-sent event ``generation``: a finished generation, and the run's progress in [0, 1]."""

    progress: float
    eta_seconds: float | None


class GeneInfo(TypedDict):
    """One gene: its nominal and its best value and its bounds; ``searched`` says whether the run estimates the gene.

    Values, bounds and ``standard_error`` are in ``unit``. ``identifiable`` says whether the recordings determine the
    gene. It and the standard errors are null until the run has succeeded, and for genes that are not searched.
    Genes that are fractions of one total are normalised to sum to one.
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
    """All genes with their values in the best genome so far; ``final`` is true once the run has succeeded."""

    genes: list[GeneInfo]
    final: bool


class RecordingResult(TypedDict):
    """Mean distance between simulated and recorded markers of one recording, for two genomes.

    ``before_mm``: with the nominal genome; ``after_mm``: with the best one. ``stage`` is the stage of the run in which
    the recording was fitted, else null; ``samples`` counts the compared pairs of frame and marker.
    """

    name: str
    held_out: bool
    stage: str | None
    samples: int
    before_mm: float | None
    after_mm: float | None


class Result(TypedDict):
    """Result of a calibration on tracks: mean distance between simulated and recorded markers, and the genes.

    ``before_mm`` (nominal genome) and ``after_mm`` (best genome) are means over the fitted recordings, weighted by the
    number of samples. ``noise_mm`` is the mean distance that tracking noise alone would cause. ``covariance`` is that
    of the genes whose standard errors are known, and ``correlations`` are those of the genes of each stage; results of
    earlier versions have none.
    """

    kind: Literal["tracks"]
    before_mm: float | None
    after_mm: float | None
    held_out_before_mm: float | None
    held_out_after_mm: float | None
    noise_mm: float | None
    remarks: list[str]
    recordings: list[RecordingResult]
    genes: list[GeneInfo]
    covariance: NotRequired[GeneCovariance | None]
    correlations: NotRequired[list[Correlations]]


class Numerics(TypedDict):
    """Accuracy and cost of a simulation.

    ``accuracy_mm`` is the requested and ``estimated_error_mm`` the estimated largest position error of any marker.
    ``beats`` were simulated until the motion was periodic; the beat in the answer has ``steps_per_beat`` time steps.
    """

    accuracy_mm: float
    estimated_error_mm: float | None
    steps_per_beat: int
    beats: int


class Comparison(TypedDict):
    """Recorded and simulated tracks, [instant][marker][x, y, z] in mm; null where not recorded.

    ``phase`` is the fraction of the beat at each instant, 0 at the start of a beat. The answer contains every
    ``stride``-th instant: all of them (1), unless the recording is too long for one answer.
    """

    recording: str
    phase: list[float]
    markers: list[str]
    recorded_mm: list[list[Point]]
    simulated_mm: list[list[Point]]
    stride: int
    numerics: Numerics


class Simulation(Comparison):
    """Tracks, their mean distance per marker (null if none was recorded), and the loads, if these were requested."""

    mean_distance_mm: float | None
    outputs: NotRequired[Outputs]


class Event(TypedDict):
    """A server-sent event: "generation" (of a run), "step" (of another job) or "state" (``data``: the whole job)."""

    id: str | None
    event: str
    data: dict[str, Any]
