"""The body of a request for a plan."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from wingfit.planning.spec import REAL, WHOLE
from wingfit.service.runs.requests import Accuracy, Axes, Division, Effects, Name, Number, VehicleModel, Whole

_EXAMPLE: dict[str, Any] = {"noise_mm": 0.4, "beats": 10, "suspects": ["added_mass", "hinge_offset"], "add": 2}


def _real(name: str, words: str) -> Any:
    least, most, _ = REAL[name]
    return Field(ge=least, le=most, description=words)


def _whole(name: str, words: str) -> Any:
    least, most = WHOLE[name]
    return Field(ge=least, le=most, description=words)


class PlanIn(VehicleModel, BaseModel):
    """A plan of an experiment like that of the dataset; what is null is as recorded."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [_EXAMPLE]})

    division: Division = "11"
    accuracy_mm: Accuracy = 0.1
    effects: Effects = []
    axes: Axes = ["x"]
    genes: Annotated[list[Name], Field(max_length=1000, description="empty: those of a calibration")] = []
    recordings: Annotated[list[Name], Field(max_length=1000, description="empty: all that are not held out")] = []
    genome: Annotated[dict[str, Number], Field(max_length=1000, description="genes not named are nominal")] = {}
    suspects: Annotated[
        Annotated[list[Name], Field(max_length=100)] | None,
        Field(description="effects that are compared; empty: all that apply; null: none"),
    ] = []
    noise_mm: Annotated[Number, _real("noise_mm", "wings only: noise of each coordinate in one frame")] | None = None
    noise_mn: Annotated[Number, _real("noise_mn", "vehicles only: white noise of one sample")] | None = None
    correlation: Annotated[Number, _real("correlation", "of the noise of successive frames")] | None = None
    scatter_percent: (
        Annotated[Number, _real("scatter_percent", "vehicles only: of the force from beat to beat")] | None
    ) = None
    zero_mn: Annotated[Number, _real("zero_mn", "vehicles only: drift of the zero of a recording")] | None = None
    beats: Annotated[Whole, _whole("beats", "of each recording")] | None = None
    frames: Annotated[Whole, _whole("frames", "or samples, per beat")] | None = None
    markers: Annotated[Whole, _whole("markers", "wings only: spread over the wing")] | None = None
    add: Annotated[Whole, _whole("add", "recordings to propose")] = 3
    power: Annotated[Number, _real("power", "with which effects are to be detected and distinguished")] = 0.9
    target_percent: Annotated[Number, _real("target_percent", "relative standard error that is identified")] = 7.5
