"""The bodies of requests about films and trackings."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from wingfit.client.films.answers import Light, MarkerKind, WingRig, WingSide
from wingfit.service.runs.requests import DATASET_ID, Name, Number, Title, Whole

MOST_CAMERAS = 8
CALIBRATION = "cameras"  # name of the file of calibrated cameras
FILM_ID = "fl_3b9ac1d07e5f2468"
MOST_MARKERS, MOST_LABELS = 2000, 5000
MOST_FRAMES = 10**9 - 1
LONGEST_DESCRIPTION = 2**20  # characters
MOST_FILMS = 40  # in one dataset: an alignment of a film takes seconds
RECORDING_NAME = r"^[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9_-])?$"


def _different(cameras: list[str]) -> list[str]:
    if len(set(cameras)) < len(cameras):
        raise PydanticCustomError("repeated", "two cameras have the same name; name each once")
    if CALIBRATION in cameras:
        raise PydanticCustomError(
            "reserved", "no camera can be called '{name}', as the file of calibrated cameras is", {"name": CALIBRATION}
        )
    return cameras


CameraName = Annotated[str, Field(max_length=40, pattern=r"^[A-Za-z0-9_-]+$")]
Frame = Annotated[Whole, Field(ge=0, le=MOST_FRAMES)]
Rate = Annotated[Number, Field(ge=1e-3, le=1e6)]


class LabelIn(BaseModel):
    """A marker that a person named in a frame of a camera; pixel (0, 0) is the centre of the upper left one."""

    model_config = ConfigDict(extra="forbid")

    camera: CameraName
    frame: Frame
    marker: Annotated[Title, Field(max_length=100)]
    x_px: Number
    y_px: Number


class FilmIn(BaseModel):
    """Body of a request that makes a film, whose files are uploaded next."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"name": "run 3", "cameras": ["left", "right"], "rate_hz": {"left": 1000.0}}]},
    )

    name: Title
    cameras: Annotated[
        list[CameraName],
        AfterValidator(_different),
        Field(min_length=2, max_length=MOST_CAMERAS, description="names, as in the file of calibrated cameras"),
    ]
    rate_hz: Annotated[
        dict[CameraName, Rate],
        Field(max_length=MOST_CAMERAS, description="frames per second, where a video states that of playback"),
    ] = {}

    @field_validator("rate_hz")
    @classmethod
    def _of_cameras(cls, rates: dict[str, float], info: ValidationInfo) -> dict[str, float]:
        cameras = info.data.get("cameras")
        other = next((name for name in rates if cameras and name not in cameras), None)
        if other is not None:
            listed = {"name": other, "cameras": ", ".join(cameras or ())}
            raise PydanticCustomError("unknown", "there is no camera '{name}', but {cameras}", listed)
        return rates


class MarkerIn(BaseModel):
    """The place of a marker on the wing, in any axes (m)."""

    model_config = ConfigDict(extra="forbid")

    marker: Annotated[Title, Field(max_length=100)]
    x_m: Number
    y_m: Number
    z_m: Number


class TrackingIn(BaseModel):
    """Body of a request to track the markers in a film; see docs/cameras.md."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"film_id": FILM_ID, "kind": "chequer", "light": "strobe", "dataset_id": DATASET_ID}]
        },
    )

    film_id: Name
    name: Title | None = None
    kind: MarkerKind
    light: Annotated[Light, Field(description="a strobe in the dark, or light that is always there")]
    clocks_within_ms: Annotated[
        Number, Field(ge=0, le=1000, description="clocks of cameras without strobe may differ by so much; 0: none do")
    ] = 0.0
    first_frame: Frame = 0
    last_frame: Annotated[Frame | None, Field(description="not included; null: all")] = None
    dataset_id: Annotated[Name | None, Field(description="of a wing, whose markers are on the filmed one")] = None
    places: Annotated[
        list[MarkerIn], Field(max_length=MOST_MARKERS, description="of the markers, instead of a dataset")
    ] = []
    labels: Annotated[
        list[LabelIn], Field(max_length=MOST_LABELS, description="markers named by hand in some frames")
    ] = []


class FilmedRecordingIn(BaseModel):
    """A recording of a dataset that is made of tracked films, and the conditions that were set for it."""

    model_config = ConfigDict(extra="forbid")

    tracking_id: Name
    name: Annotated[str, Field(max_length=100, pattern=RECORDING_NAME)]
    rig: WingRig
    flap_frequency_hz: Annotated[
        Number, Field(gt=0, le=1000, description="as set, to 2 %; the dataset gets the one on the clock of the cameras")
    ]
    phase_lag_deg: Annotated[Number, Field(ge=-180, le=180)]
    pressure_mbar: Annotated[Number, Field(ge=0)]
    temperature_c: Number
    airspeed_m_s: Annotated[Number, Field(ge=0)] = 0.0
    angle_of_attack_deg: Annotated[Number, Field(ge=-90, le=90)] = 0.0
    held_out: bool = False


class FilmedDatasetIn(BaseModel):
    """Body of a request that makes a dataset of tracked films, in the frame of the described wing."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "name": "wing in the chamber",
                    "dataset_id": DATASET_ID,
                    "recordings": [
                        {
                            "tracking_id": "tk_9e0b6a7c1d2f3458",
                            "name": "vacuum",
                            "rig": "vacuum_chamber",
                            "flap_frequency_hz": 3.0,
                            "phase_lag_deg": 3.0,
                            "pressure_mbar": 10.0,
                            "temperature_c": 20.0,
                        }
                    ],
                }
            ]
        },
    )

    name: Title
    dataset_id: Annotated[Name | None, Field(description="of a dataset that describes the filmed wing")] = None
    description: Annotated[
        str | None,
        Field(max_length=LONGEST_DESCRIPTION, description="instead: dataset.yaml, or the keys of a wing, as text"),
    ] = None
    recordings: Annotated[list[FilmedRecordingIn], Field(min_length=1, max_length=MOST_FILMS)]
    side: Annotated[WingSide | None, Field(description="of the wing; null: estimated")] = None
    up: Annotated[
        str | None,
        Field(max_length=2, pattern="^-?[xyz]$", description="axis of the tracks that is up; null: estimated"),
    ] = None
    mean_flap_deg: Annotated[
        Number | None, Field(gt=-90, lt=90, description="mean flap angle over the beat; null: that of the drive")
    ] = None
    ignore_names: Annotated[bool, Field(description="the names of the tracks say nothing about markers")] = False

    @field_validator("recordings")
    @classmethod
    def _names_differ(cls, recordings: list[FilmedRecordingIn]) -> list[FilmedRecordingIn]:
        for what in ("name", "tracking_id"):
            values = [getattr(one, what) for one in recordings]
            if twice := next((value for value in values if values.count(value) > 1), None):
                message = "two recordings have the {what} '{value}'; each has its own"
                raise PydanticCustomError("repeated", message, {"what": what, "value": twice})
        return recordings
