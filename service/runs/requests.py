"""The body of a request for a run, and the types of fields that other requests share."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StrictBool
from pydantic_core import PydanticCustomError

from wingfit.calibration.limits import REAL, WHOLE
from wingfit.service.rigs.stored_rig import RigIn

Mode = Literal["staged", "joint", "local"]
Method = Literal["genetic", "cma_es", "gauss_newton", "auto"]
Preset = Literal["proposed", "berman_wang", "dickinson"]
ForceAxis = Literal["x", "z"]
AnyName = TypeVar("AnyName", bound=str)

DATASET_ID = "ds_0f3c9a7be1d24568"
DIVISION = r"^[1-9][0-9]?(x[1-9][0-9]?|(,[1-9][0-9]?){0,63})$"
LONGEST_DIVISION = 200
DIVISION_FORMS = "preset 4, 11, 24; strips x bodies of each: 6x4; or bodies of each strip, root first: 3,3,3,2"
FINEST_MM, COARSEST_MM = 0.02, 1.0

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Whole = Annotated[int, Field(strict=True)]
# Control characters, and those that take no room or turn the text after them around.
_HIDDEN = r"\u0000-\u001f\u007f-\u009f\u200b\u200e\u200f\u2028-\u202e\u2060-\u2069\ufeff"
TITLE = rf"^[^{_HIDDEN}]*[^{_HIDDEN}\s][^{_HIDDEN}]*$"


# What notes may not have: other control characters than tabs and ends of lines, and half a surrogate pair.
_UNWRITTEN = re.compile(r"[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
LONGEST_NOTES = 10_000  # characters


def _visible(title: str) -> str:
    # Half a surrogate pair is no character: it can be sent as JSON, and neither stored nor shown. The published pattern
    # leaves it out, because to many readers of patterns every character beyond U+FFFF is two halves.
    if not re.fullmatch(TITLE, title) or re.search(r"[\ud800-\udfff]", title):
        raise PydanticCustomError("title", "must be one line of text that can be seen, without control characters")
    return title


Title = Annotated[
    str, AfterValidator(_visible), Field(min_length=1, max_length=200, json_schema_extra={"pattern": TITLE})
]


def _written(notes: str) -> str:
    if hidden := _UNWRITTEN.search(notes):
        code = f"U+{ord(hidden[0]):04X}"
        raise PydanticCustomError("notes", "must be text without control characters; it has {code}", {"code": code})
    return notes


Notes = Annotated[str, AfterValidator(_written), Field(max_length=LONGEST_NOTES)]


def _readable(division: str) -> str:
    if len(division) > LONGEST_DIVISION or not re.fullmatch(DIVISION, division):
        raise PydanticCustomError("division", "must be a {forms}", {"forms": DIVISION_FORMS})
    return division


Division = Annotated[
    str,
    AfterValidator(_readable),
    Field(json_schema_extra={"pattern": DIVISION, "maxLength": LONGEST_DIVISION}, description=DIVISION_FORMS),
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


def once(names: list[AnyName]) -> list[AnyName]:
    """Return ``names`` unchanged; raise a validation error if one of them occurs twice."""
    for name in names:
        if names.count(name) > 1:
            raise PydanticCustomError("repeated", "must name each once; {name} is there twice", {"name": name})
    return names


def within(name: str, description: str | None = None) -> Any:
    """Return the field of setting ``name`` with the limits that a calibration has."""
    least, most = (WHOLE | REAL)[name]
    return Field(ge=least, le=most, description=description)


Axes = Annotated[
    list[ForceAxis],
    AfterValidator(once),
    Field(
        min_length=1,
        max_length=2,
        json_schema_extra={"uniqueItems": True},
        description="vehicles only: force axes that are fitted",
    ),
]

Effects = Annotated[
    list[Name],
    Field(max_length=100, description="effects that the model contains as well, see /v1/effects; fitted like others"),
]


class VehicleModel(BaseModel):
    """Settings for the model of a vehicle, and the filter of its recorded forces; a wing has none of these settings."""

    preset: Annotated[Preset, Field(description="vehicles only: blade-element model, see /v1/models")] = "proposed"
    without: Annotated[list[Name], Field(max_length=100, description="vehicles only: terms to leave out")] = []
    low_pass_hz: Annotated[
        Annotated[Number, Field(ge=0, le=1e6)] | None,
        Field(description="vehicles only: cut-off for forces; null: 3.2 x flap frequency; 0: not filtered"),
    ] = None
    peel_width_beats: Annotated[
        Number, Field(ge=0, le=0.5, description="vehicles only: over which the end of the peel is smoothed")
    ] = 0.0


class JobSettings(VehicleModel):
    """Settings that runs and diagnoses share; see `wingfit.calibration.spec.CalibrationSpec`."""

    division: Division = "11"
    seed: Annotated[Whole, within("seed")] = 1
    bounds_factor: Annotated[Number, within("bounds_factor")] = 5.0
    accuracy_mm: Accuracy = 0.1
    recordings: Annotated[list[Name], Field(max_length=1000, description="empty: all that are not held out")] = []
    effects: Effects = []


class RunIn(JobSettings):
    """Body of a request for a calibration run."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"dataset_id": DATASET_ID, "division": "11", "name": "first try"}]},
    )

    dataset_id: Name
    rig: RigIn | None = None
    name: Title | None = None
    mode: Annotated[
        Mode | None,
        Field(description="null: staged for a wing, joint for a rigid one and for series, local for a vehicle"),
    ] = None
    method: Annotated[
        Method | None, Field(description="null: genetic for a wing, gauss_newton for a vehicle, auto for series")
    ] = None
    population: Annotated[Whole, within("population")] = 50
    stall: Annotated[Whole, within("stall")] = 10
    tolerance: Annotated[Number, within("tolerance")] = 1e-3
    max_generations: Annotated[Whole, within("max_generations", "per stage")] = 200
    genes: Annotated[
        list[Name], Field(max_length=1000, description="empty: all of a wing; lift, rotation and fling of a vehicle")
    ] = []
    search_division: Annotated[
        Division | None,
        Field(
            description="wings only: discretisation that the search simulates, before Gauss-Newton with `division`; "
            "with auto, or with finish; null: division"
        ),
    ] = None
    finish: Annotated[
        StrictBool, Field(description="Gauss-Newton after the search of each stage; auto ends so anyway")
    ] = False
    axes: Axes = ["x"]
