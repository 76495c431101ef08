"""JSON answers of the server about films, and about the tracking of markers in them."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict

from wingfit.client.answers import Dataset, State

MarkerKind = Literal["chequer", "dot"]
Light = Literal["strobe", "continuous"]
WingSide = Literal["left", "right"]
WingRig = Literal["vacuum_chamber", "wind_tunnel"]
Pixel = list[float]


class FilmCamera(TypedDict):
    """A camera of a film, and its video: all but ``name`` are null before the upload, ``rate_hz`` unless stated.

    ``frames`` is what the file states, and may be off by a few.
    """

    name: str
    bytes: int | None
    frames: int | None
    width_px: int | None
    height_px: int | None
    rate_hz: float | None


class Film(TypedDict):
    """The films of one recording with several cameras.

    ``calibration`` says whether the file of calibrated cameras is there; ``ready`` whether all files are, so that the
    film can be tracked. ``missing`` names files that were uploaded but are not on the disk of the server, as after the
    restoration of a backup, which holds no films: upload them again.
    """

    id: str
    name: str
    created_at: str
    cameras: list[FilmCamera]
    calibration: bool
    ready: bool
    missing: list[str]
    size_bytes: int


class FoundMarker(TypedDict):
    """A marker that the detector sees in a frame; pixel (0, 0) is the centre of the upper left one."""

    x_px: float
    y_px: float


class FoundMarkers(TypedDict):
    """The markers that the detector sees in one frame; they have no names yet."""

    markers: list[FoundMarker]


class MarkerPlace(TypedDict):
    """The place of a marker on the wing, in any axes."""

    marker: str
    x_m: float
    y_m: float
    z_m: float


class Label(TypedDict):
    """A marker that a person named in a frame of a camera."""

    camera: str
    frame: int
    marker: str
    x_px: float
    y_px: float


class TrackingSpec(TypedDict):
    """The settings of a tracking; ``places`` are those of the request or of the dataset, empty if there are none."""

    kind: MarkerKind
    light: Light
    clocks_within_ms: float
    first_frame: int
    last_frame: int | None
    places: list[MarkerPlace]
    labels: list[Label]


class Tracking(TypedDict):
    """The tracking of the markers in a film: a job.

    ``stage`` is "detecting", "instants", "rays" or "following", null before the first; ``progress`` lies in [0, 1];
    ``eta_seconds`` estimates the remaining time; ``dataset_id`` names the wing whose markers are tracked, else null.
    ``pending_action`` is a cancellation that has not taken effect yet; ``steps`` counts reports of progress; ``error``
    says why it failed, else null.
    """

    id: str
    name: str
    film_id: str
    dataset_id: str | None
    spec: TrackingSpec
    state: State
    stage: str | None
    progress: float
    eta_seconds: float | None
    created_at: str
    started_at: str | None
    finished_at: str | None
    pending_action: Literal["CANCEL"] | None
    steps: int
    error: str | None


class TrackingStep(TypedDict):
    """The data of the server-sent event ``step``, a report on the progress of a tracking in [0, 1]."""

    sequence: int
    stage: str
    progress: float
    elapsed_seconds: float
    eta_seconds: float | None


class MarkerSummary(TypedDict):
    """How well one marker was tracked; ``standard_deviation_mm`` is null if it was never found.

    ``rejected`` counts places left out because rays do not meet, or because the marker jumps.
    """

    found_percent: float
    standard_deviation_mm: float | None
    rejected: int


class CameraSummary(TypedDict):
    """Residual (RMS of one pixel coordinate) of one camera, and up to 20 frames that could not be decoded."""

    residual_px: float | None
    bad_frames: list[int]


class SeenMarker(TypedDict):
    """Where a camera saw a marker, and where its place in space appears; null if not seen, or without a place."""

    marker: str
    seen_px: Pixel | None
    projected_px: Pixel | None


class SeenFrame(TypedDict):
    """One instant in one camera; ``frame`` is the number of the frame that shows it, with a strobe the first of two."""

    camera: str
    frame: int
    markers: list[SeenMarker]


class SeenInstant(TypedDict):
    """One instant in all cameras."""

    time_s: float
    cameras: list[SeenFrame]


class TrackingResult(TypedDict):
    """Summary of the tracks of a film.

    ``times_s`` and ``found``, the count of markers with a place, are thinned to every ``stride``-th instant; ``shown``
    has a few instants spread over the film. ``pixel_error_px`` is the standard deviation of a pixel, beside that of its
    detection, for which the misfits are as expected.
    """

    instants: int
    seconds: float
    markers: dict[str, MarkerSummary]
    markers_found_median: float
    cameras: dict[str, CameraSummary]
    pixel_error_px: float | None
    remarks: list[str]
    stride: int
    times_s: list[float]
    found: list[int]
    shown: list[SeenInstant]


class UnusedTrack(TypedDict):
    """A track that is no described marker, and the reason."""

    track: str
    reason: str


class FilmAlignment(TypedDict):
    """How well the tracks of one film were brought to the frame of the wing.

    ``residual_mm`` is the standard deviation of a coordinate against the modelled motion, ``rest_scatter_mm`` that of
    the described rest positions; ``flap_frequency_hz`` is on the clock of the cameras; ``flap_amplitude_deg`` half the
    range of the flap angle; ``exchanges`` counts parts of tracks that belong to other markers than their tracks.
    """

    recording: str
    tracking_id: str
    side: WingSide
    residual_mm: float
    rest_scatter_mm: float
    flap_frequency_hz: float
    flap_amplitude_deg: float
    mean_flap_deg: float
    frames: int
    markers: list[str]
    exchanges: int
    dropped: list[UnusedTrack]
    remarks: list[str]


class FilmedDataset(TypedDict):
    """A dataset that was made of tracked films, and how each was aligned to its wing."""

    dataset: Dataset
    alignments: list[FilmAlignment]
