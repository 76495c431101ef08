"""Loads, powers and energies on the wire; axes and signs are in docs/api.md."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool, ValidationError, WrapValidator
from pydantic_core import PydanticCustomError
from pydantic_core.core_schema import ValidatorFunctionWrapHandler

OutputName = Literal["motors", "air", "strips", "sections", "connectors", "power", "energy", "averages"]
OUTPUT_NAMES: tuple[OutputName, ...] = (
    "motors",
    "air",
    "strips",
    "sections",
    "connectors",
    "power",
    "energy",
    "averages",
)
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

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Series = list[float]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Vectors = list[Vector]


class ConditionIn(BaseModel):
    """What differs from the recording's condition; limits as in `dataset.yaml`."""

    model_config = ConfigDict(extra="forbid")

    flap_frequency_hz: Annotated[Number, Field(ge=0.01, le=1000)] | None = None
    phase_lag_deg: Annotated[Number, Field(ge=-180, le=180)] | None = None
    pressure_mbar: Annotated[Number, Field(ge=0, le=20_000)] | None = None
    temperature_c: Annotated[Number, Field(ge=-100, le=100)] | None = None
    airspeed_m_s: Annotated[Number, Field(ge=0, le=100)] | None = None
    angle_of_attack_deg: Annotated[Number, Field(ge=-90, le=90)] | None = None


class MotorsOut(BaseModel):
    """One series for each motor."""

    front: Series
    rear: Series


class MotorPairOut(BaseModel):
    """One number for each motor."""

    front: float
    rear: float


class PowerOut(BaseModel):
    """Power into the wing through each port; that through the dampers is never positive."""

    front_motor: Series
    rear_motor: Series
    air: Series
    dampers: Series


class EnergyOut(BaseModel):
    """Energy in the wing."""

    kinetic: Series
    elastic: Series
    gravitational: Series


class StripOut(BaseModel):
    """Air on one strip; ``span_mm``: its edges."""

    name: str
    span_mm: Annotated[list[float], Field(min_length=2, max_length=2)]
    lift_n: Series
    thrust_n: Series
    side_n: Series
    power_w: Series


class SectionOut(BaseModel):
    """Load of the inner on the outer part of the wing through a cut at ``span_mm``."""

    name: str
    span_mm: float
    moment_n_m: Vectors
    force_n: Vectors


class ConnectorOut(BaseModel):
    """Wrench on, and motion of, the second of the bodies ``between`` relative to the first, in the first's axes."""

    name: str
    kind: Literal["root", "spanwise", "chordwise"]
    between: Annotated[list[str], Field(min_length=2, max_length=2)]
    point_mm: Vector
    moment_n_m: Vectors
    force_n: Vectors
    angular_velocity_rad_s: Vectors
    velocity_m_s: Vectors
    dissipated_w: Series
    stored_j: Series


class AveragesOut(BaseModel):
    """Means over the beat, and the largest motor torques; supplied = dissipated + to air + closing error."""

    lift_n: float
    thrust_n: float
    side_n: float
    motor_power_w: MotorPairOut
    peak_motor_torque_n_m: MotorPairOut
    supplied_w: float
    dissipated_w: float
    to_air_w: float
    closing_error_w: float
    closing_error_percent: float
    dissipated_by_connector_w: dict[str, float]


class SolvedOut(BaseModel):
    """How the beat was solved: loads are solved better than tracks where they can be."""

    steps_per_beat: int
    beats: int
    estimated_error_mm: float | None


class OutputsOut(BaseModel):
    """One periodic beat in order of ``phase``; only what was asked for is there."""

    phase: Series
    drive_phase: Series
    solved: SolvedOut | None = None
    motor_angle_deg: MotorsOut | None = None
    motor_rate_rad_s: MotorsOut | None = None
    motor_torque_n_m: MotorsOut | None = None
    motor_power_w: MotorsOut | None = None
    lift_n: Series | None = None
    thrust_n: Series | None = None
    side_n: Series | None = None
    strips: list[StripOut] | None = None
    sections: list[SectionOut] | None = None
    connectors: list[ConnectorOut] | None = None
    power_w: PowerOut | None = None
    energy_j: EnergyOut | None = None
    averages: AveragesOut | None = None


class LoadsOut(BaseModel):
    """Loads under a recording's condition, or one that differs from it in what the request says."""

    recording: str
    outputs: OutputsOut
