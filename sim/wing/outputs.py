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
    """One driving rod over n instants.

    ``angle`` (rad) and ``rate`` (rad/s) about the hinge, positive on the upstroke; ``torque`` (N m) of the motor on the
    rod about the hinge axis, ``power`` (W) = torque times rate, into the wing.
    """

    angle: Array
    rate: Array
    torque: Array
    power: Array


@dataclass(frozen=True)
class ConnectorLoad:
    """One connector over n instants. It joins ``between`` = (first, second); second is the outer or rear one.

    ``wrench`` [n, 6]: moment (N m) and force (N) on the second body, ``twist`` [n, 6]: its angular velocity (rad/s) and
    velocity (m/s) relative to the first; both in the axes of the first body, at the connector's point on the second
    (frame B of :mod:`wingfit.sim.kernels.connectors`). The power that the connector returns is
    wrench . twist = -dissipated - d stored / dt (thesis Eqs. 4-7). ``dissipated`` [n] in its damper, W, ``stored`` [n]
    in its spring, J. ``point``: its position at rest, wing frame, m.
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
    """Load through a section of the span at ``span`` (m): that of the inboard part on the outboard part.

    ``wrench`` [n, 6]: moment (N m) and force (N) in the mean axes of the outboard strip (x aft, y along the span, z
    normal), at the mean of the connectors' points: bending is about x, torsion about y, bending in the plane about z.
    """

    name: str
    span: float
    wrench: Array


@dataclass(frozen=True)
class Strip:
    """Air on one strip: ``force`` [n, 3] in the world, N; ``power`` [n] into the wing, W; ``span``: its edges, m."""

    name: str
    span: tuple[float, float]
    force: Array
    power: Array


@dataclass(frozen=True)
class Outputs:
    """One individual over one periodic beat, at n equal steps from drive phase 0.

    Attributes:
        phase: [n] of the drive, beats, from 0.
        crossing: drive phase (beats) of the upstroke crossing, where the phase of recordings is 0.
        motors: front and rear.
        connectors: wrench, relative twist, loss and energy of each.
        sections: loads through the sections between strips, root first.
        strips: air loads, root first.
        air_wrench: [n, N, 6] of the air on each body, in its frame at its centre of mass.
        held: [n, N, 6], as ``air_wrench``, of what effects apply at points of the wing, such as a tether.
        held_lost, held_stored: [n] power that these effects dissipate (W) and energy that they store (J).
        lift_axis, thrust_axis: unit vectors in the world. In wind: perpendicular to the stream (in the plane of flow
            and vertical), and against it; without wind: up, and forward (-x). The side force is along y, outboard.
        kinetic, elastic, gravitational: [n] energies, J; gravitational is zero at z = 0.
        solution: how the beat was solved; None for a given motion.
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
        """Force of the air on the wing in the world [n, 3], N."""
        return np.asarray(sum(strip.force for strip in self.strips))

    @property
    def air_power(self) -> Array:
        """Power of the air into the wing [n], W."""
        return np.asarray(sum(strip.power for strip in self.strips))

    @property
    def dissipated(self) -> Array:
        """Power lost in all dampers [n], W."""
        return np.asarray(sum(connector.dissipated for connector in self.connectors) + self.held_lost)

    @property
    def balance(self) -> Balance:
        """Mean powers over the beat: of the motors, in the dampers and to the air."""
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
        """Supplied minus dissipated minus given to the air, W; zero except for integration errors and transients."""
        return self.supplied - self.dissipated - self.to_air

    @property
    def relative_closing(self) -> float:
        """The closing error relative to the mean power that enters the wing; 0 if none does."""
        entering = max(self.supplied, 0.0) + max(-self.to_air, 0.0)
        return self.closing / entering if entering > 0 else 0.0
