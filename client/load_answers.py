"""JSON answers about loads, powers and energies over one beat; ``docs/api.md`` gives axes and signs."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Len
from typing_extensions import TypedDict

Series = list[float]
Vector = Annotated[list[float], Len(3, 3)]
Vectors = list[Vector]
MotorSeries = dict[Literal["front", "rear"], Series]
MotorPair = dict[Literal["front", "rear"], float]


class Strip(TypedDict):
    """Aerodynamic load on one spanwise strip of the wing; ``span_mm`` holds its inner and outer edge."""

    name: str
    span_mm: Annotated[list[float], Len(2, 2)]
    lift_n: Series
    thrust_n: Series
    side_n: Series
    power_w: Series


class SectionLoad(TypedDict):
    """Load that the inner part of the wing exerts on the outer at the cut ``span_mm``; vectors [phase][x, y, z]."""

    name: str
    span_mm: float
    moment_n_m: Vectors
    force_n: Vectors


class ConnectorLoad(TypedDict):
    """Wrench on the second body of ``between``, and its motion relative to the first, in the first body's axes."""

    name: str
    kind: Literal["root", "spanwise", "chordwise"]
    between: Annotated[list[str], Len(2, 2)]
    point_mm: Vector
    moment_n_m: Vectors
    force_n: Vectors
    angular_velocity_rad_s: Vectors
    velocity_m_s: Vectors
    dissipated_w: Series
    stored_j: Series


class Averages(TypedDict):
    """Means over the beat, and the largest motor torques.

    Energy balance: ``supplied_w`` = ``dissipated_w`` + ``to_air_w`` + ``closing_error_w`` (numerical error).
    """

    lift_n: float
    thrust_n: float
    side_n: float
    motor_power_w: MotorPair
    peak_motor_torque_n_m: MotorPair
    supplied_w: float
    dissipated_w: float
    to_air_w: float
    closing_error_w: float
    closing_error_percent: float
    dissipated_by_connector_w: dict[str, float]


class OutputNumerics(TypedDict):
    """Time steps and error of the simulated beat; loads are solved more accurately than tracks where possible."""

    steps_per_beat: int
    beats: int
    estimated_error_mm: float | None


class OutputGroups(TypedDict, total=False):
    """The outputs that can be requested; each series has one value per ``phase`` of the beat."""

    numerics: OutputNumerics
    motor_angle_deg: MotorSeries
    motor_rate_rad_s: MotorSeries
    motor_torque_n_m: MotorSeries
    motor_power_w: MotorSeries
    lift_n: Series
    thrust_n: Series
    side_n: Series
    strips: list[Strip]
    sections: list[SectionLoad]
    connectors: list[ConnectorLoad]
    power_w: dict[Literal["front_motor", "rear_motor", "air", "dampers"], Series]
    energy_j: dict[Literal["kinetic", "elastic", "gravitational"], Series]
    averages: Averages


class Outputs(OutputGroups):
    """One periodic beat in order of ``phase``, with those outputs that were requested.

    ``power_w`` is the power into the wing through each port; the power through the dampers is never positive.
    """

    phase: Series
    drive_phase: Series


class Loads(TypedDict):
    """Simulated loads under the condition of ``recording``, with the changes to it that the request gave."""

    recording: str
    outputs: Outputs
