"""Results of one periodic beat of a wing: loads, powers and energies (thesis III, Figs. 4-6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.model import Solution

Kind = Literal["root", "spanwise", "chordwise"]


@dataclass(frozen=True)
class Motor:
    """One driving rod and its motor at n instants of a beat, an array [n] each.

    ``angle`` (rad) and ``rate`` (rad/s) of the rod about the hinge, positive on the upstroke; ``torque`` (N m) of the
    motor on the rod about the hinge axis; ``power`` (W) of the motor, torque times rate.
    """

    angle: Array
    rate: Array
    torque: Array
    power: Array


@dataclass(frozen=True)
class ConnectorLoad:
    """Load and motion of one connector (spring and damper between two bodies) at n instants of a beat.

    Vectors are in the axes of the first body, taken at the connector's point on the second (frame B of
    :mod:`wingfit.sim.kernels.connectors`). The power that the connector returns to the bodies is wrench . twist =
    -dissipated - d stored / dt (thesis Eqs. 4-7).

    Attributes:
        between: names of the first and the second body; the second is the outer or the rear one.
        point: [3] position of the connector at rest, wing frame, m.
        wrench: [n, 6] moment (N m) and force (N) on the second body.
        twist: [n, 6] angular velocity (rad/s) and velocity (m/s) of the second body relative to the first.
        dissipated: [n] power dissipated in the damper, W.
        stored: [n] energy stored in the spring, J.
    """

    name: str
    kind: Kind
    between: tuple[str, str]
    point: Array
    wrench: Array
    twist: Array
    dissipated: Array
    stored: Array


@dataclass(frozen=True)
class Section:
    """Load of the inboard part of the wing on the outboard part, through the section at span position ``span`` (m).

    ``wrench`` [n, 6] at n instants: moment (N m) and force (N), in the mean axes of the outboard strip (x aft, y along
    the span, z normal), at the mean of the connectors' points in the section. The moment about x is bending, that about
    y is torsion, that about z is bending in the plane of the wing.
    """

    name: str
    span: float
    wrench: Array


@dataclass(frozen=True)
class Strip:
    """Air load on one strip at n instants: ``force`` [n, 3] in the world, N; ``power`` [n] of the air on the wing, W.

    ``span``: positions of the strip's inner and outer edge, m.
    """

    name: str
    span: tuple[float, float]
    force: Array
    power: Array


@dataclass(frozen=True)
class Outputs:
    """One individual over one periodic beat, at n equal steps from drive phase 0; N is the number of bodies.

    Attributes:
        phase: [n] phase of the drive, beats, from 0.
        crossing: drive phase (beats) at which the reference markers cross the hinge height on the upstroke. There the
            phase
        of recordings is 0.
        motors: front and rear driving rod.
        connectors: loads of all connectors.
        sections: loads through the root and between strips, from root to tip.
        strips: air loads, from root to tip.
        air_wrench: [n, N, 6] moment (N m) and force (N) of the air on each body, in its frame at its centre of mass.
        held: [n, N, 6] moment and force, as ``air_wrench``, of effects that act at points of the wing, such as a
            tether.
        held_lost, held_stored: [n] power that these effects dissipate (W) and energy that they store (J).
        lift_axis, thrust_axis: [3] unit vectors in the world. With wind, lift is perpendicular to the stream, in the
            plane
        of stream and vertical, and thrust is against the stream. Without wind, lift is up (z) and thrust is forward
        (-x). The side force is along y, outboard.
        kinetic, elastic, gravitational: [n] energies, J; gravitational is zero at z = 0.
        solution: how the beat was computed; None if its motion was given.
    """

    phase: Array
    crossing: float
    motors: tuple[Motor, Motor]
    connectors: tuple[ConnectorLoad, ...]
    sections: tuple[Section, ...]
    strips: tuple[Strip, ...]
    air_wrench: Array
    held: Array
    held_lost: Array
    held_stored: Array
    lift_axis: Array
    thrust_axis: Array
    kinetic: Array
    elastic: Array
    gravitational: Array
    solution: Solution | None = None

    @property
    def air(self) -> Array:
        """Force [n, 3] of the air on the wing in the world, N."""
        return np.asarray(sum(strip.force for strip in self.strips))

    @property
    def air_power(self) -> Array:
        """Power [n] of the air on the wing, W."""
        return np.asarray(sum(strip.power for strip in self.strips))

    @property
    def dissipated(self) -> Array:
        """Power [n] dissipated in all dampers and in effects that act at points of the wing, W."""
        return np.asarray(sum(connector.dissipated for connector in self.connectors) + self.held_lost)

    @property
    def balance(self) -> Balance:
        """Mean powers over the beat: from the motors, into the dampers and to the air."""
        front, rear = (float(motor.power.mean()) for motor in self.motors)
        return Balance(front, rear, float(self.dissipated.mean()), -float(self.air_power.mean()))


@dataclass(frozen=True)
class Balance:
    """Mean powers over a periodic beat, W: supplied by the motors, dissipated in the dampers, given to the air."""

    front_motor: float
    rear_motor: float
    dissipated: float
    to_air: float

    @property
    def supplied(self) -> float:
        """Mean power supplied by both motors, W."""
        return self.front_motor + self.rear_motor

    @property
    def closing(self) -> float:
        """Supplied minus dissipated minus given to the air, W: zero but for integration errors and transients."""
        return self.supplied - self.dissipated - self.to_air

    @property
    def relative_closing(self) -> float:
        """``closing`` divided by the mean power that enters the wing; 0 if none enters."""
        entering = max(self.supplied, 0.0) + max(-self.to_air, 0.0)
        return self.closing / entering if entering > 0 else 0.0
