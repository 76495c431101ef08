"""The bodies of requests about films and trackings."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from wingfit.client.films.answers import Light, MarkerKind
from wingfit.service.runs.requests import DATASET_ID, Name, Number, Title, Whole

MOST_CAMERAS = 8
CALIBRATION = "cameras"  # name of the file of calibrated cameras
FILM_ID = "fl_3b9ac1d07e5f2468"
MOST_MARKERS, MOST_LABELS = 2000, 5000
MOST_FRAMES = 10**9 - 1


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
