"""JSON answers about loads, powers and energies of a wing over one beat; ``docs/api.md`` gives axes and signs."""

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
    """Force of the air on, and power into, one spanwise strip of the wing; ``span_mm``: its inner and outer edge."""

    name: str
    span_mm: Annotated[list[float], Len(2, 2)]
    lift_n: Series
    thrust_n: Series
    side_n: Series
    power_w: Series


class SectionLoad(TypedDict):
    """Moment and force that the part of the wing inboard of the cut at ``span_mm`` exerts on the part outboard of it.

    Axes are those of the strip outboard of the cut: x aft, y along the span, z normal to the wing.
    """

    name: str
    span_mm: float
    moment_n_m: Vectors
    force_n: Vectors


class ConnectorLoad(TypedDict):
    """Load in the connector that joins two rigid bodies of the wing, ``between`` = [first, second].

    Moment and force act on the second body; angular velocity and velocity are those of the second body relative to the
    first; all are in the axes of the first body. ``point_mm`` is the connector's position at rest. ``dissipated_w`` is
    the power lost in its damper, ``stored_j`` the energy in its spring.
    """

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

    Energy balance: ``supplied_w`` (by both motors) = ``dissipated_w`` (in dampers) + ``to_air_w`` +
    ``closing_error_w`` (error of the integrator and transients); in percent of the mean power that enters the wing.
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
    """Accuracy of the simulated beat: the number of beats until it was periodic, its time steps, its position error."""

    steps_per_beat: int
    beats: int
    estimated_error_mm: float | None


class OutputGroups(TypedDict, total=False):
    """The outputs that can be requested; an output that was not requested is absent. See :class:`Outputs`."""

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
    """The requested outputs over one periodic beat; each series has one value per entry of ``phase``, in that order.

    ``phase`` is the fraction of the beat, 0 at the start of a beat of the tracks; ``drive_phase`` is counted from the
    zero of the drive. ``power_w`` is the power into the wing from each motor, from the air, and from the dampers (never
    positive).
    """

    phase: Series
    drive_phase: Series


class Loads(TypedDict):
    """Simulated loads under the condition of ``recording``, as changed by the request if that gave a condition."""

    recording: str
    outputs: Outputs
