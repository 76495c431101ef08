"""The bodies of requests for simulations, loads and predictions."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, StrictBool, ValidationError, WrapValidator
from pydantic_core import PydanticCustomError
from pydantic_core.core_schema import ValidatorFunctionWrapHandler

from wingfit.service.runs.requests import DATASET_ID, Accuracy, Division, Effects, Name, Number, VehicleModel

RECORDING = "vacuum-3hz-0deg"
OutputName = Literal["motors", "air", "strips", "sections", "connectors", "power", "energy", "averages"]
_EXAMPLE: dict[str, Any] = {"dataset_id": DATASET_ID, "recording": RECORDING, "outputs": ["motors", "averages"]}
OUTPUT_NAMES: tuple[OutputName, ...] = get_args(OutputName)
OutputNames = Annotated[list[OutputName], Field(max_length=len(OUTPUT_NAMES))]


def _one_complaint(value: Any, either: ValidatorFunctionWrapHandler) -> Any:
    try:
        return either(value)
    except ValidationError:  # two of them, one for each type that it might have been
        message = "must be true, false, or a list of at most {most} of {names}"
        limits = {"most": len(OUTPUT_NAMES), "names": ", ".join(OUTPUT_NAMES)}
        raise PydanticCustomError("outputs", message, limits) from None


Wanted = Annotated[
    StrictBool | OutputNames,
    WrapValidator(_one_complaint),
    Field(description=f"true for all, or some of {', '.join(OUTPUT_NAMES)}"),
]


class ConditionIn(BaseModel):
    """Changes to the recording's condition; omitted fields stay as recorded. Limits as in `dataset.yaml`."""

    model_config = ConfigDict(extra="forbid")

    flap_frequency_hz: Annotated[Number, Field(ge=0.01, le=1000)] | None = None
    phase_lag_deg: Annotated[Number, Field(ge=-180, le=180)] | None = None
    pressure_mbar: Annotated[Number, Field(ge=0, le=20_000)] | None = None
    temperature_c: Annotated[Number, Field(ge=-100, le=100)] | None = None
    airspeed_m_s: Annotated[Number, Field(ge=0, le=100)] | None = None
    angle_of_attack_deg: Annotated[Number, Field(ge=-90, le=90)] | None = None


class WingIn(BaseModel):
    """Settings of a simulation of a wing; genes that are not named keep their nominal value."""

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

    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE | {"division": "4", "genome": {"E_f": 7e6}}]})


class LoadsIn(WingIn):
    """A simulation of the loads alone, in the recording's condition or one that differs from it."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [_EXAMPLE | {"condition": {"flap_frequency_hz": 5.0, "airspeed_m_s": 4.0}}]}
    )

    condition: ConditionIn = ConditionIn()
    outputs: Wanted = True


class PredictionIn(BaseModel):
    """A condition in which to predict forces; limits as in `dataset.yaml`."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"flap_frequency_hz": 12.0, "body_pitch_deg": 60.0, "airspeed_m_s": 0.7}]},
    )

    flap_frequency_hz: Annotated[Number, Field(ge=0.01, le=1000)]
    body_pitch_deg: Annotated[Number, Field(ge=-90, le=90)]
    airspeed_m_s: Annotated[Number, Field(ge=0, le=100)]
    pressure_mbar: Annotated[Number, Field(ge=0, le=20_000)] = 1013.25
    temperature_c: Annotated[Number, Field(ge=-100, le=100)] = 20.0
