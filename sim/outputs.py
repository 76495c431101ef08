"""What a bond graph answers: loads, powers and energies of one wing over one periodic beat (thesis III, Figs. 4-6).

Everything follows from the motion that :meth:`sim.flexible_wing.FlexibleWing.beat` keeps, through the same compiled
laws that made it: the lanes of a kernel, elsewhere individuals, are here eight instants of one individual.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from records import Condition
from sim.kernels import LANES
from sim.kernels.air import strip_forces
from sim.kernels.bodies import kinetic_and_height
from sim.kernels.connectors import connect, relative_pose
from sim.kernels.integrate import Lanes, State
from sim.model import Solution
from sim.scene import setting
from sim.structure import Structure

Array = npt.NDArray[np.float64]
Kind = Literal["root", "spanwise", "chordwise"]
RODS = ("front rod", "rear rod")


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
    velocity (m/s) relative to the first; both in the axes of the first body, at the point where the connector holds the
    second (frame B of :mod:`sim.kernels.connectors`). Effort times flow is what the connector gives back:
    wrench . twist = -dissipated - d stored / dt (thesis Eqs. 4-7). ``dissipated`` [n] in its damper, W, ``stored`` [n]
    in its spring, J. ``point``: where it is at rest, wing frame, m.
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
    """Load through a cut across the span: all that the part inboard of ``span`` (m) exerts on the part outboard.

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
        crossing: drive phase (beats) of the upstroke crossing, where the phase of a comparison is 0.
        motors: front and rear.
        connectors: wrench, relative twist, loss and energy of each.
        sections: loads through the cuts between strips, root first.
        strips: air loads, root first.
        air_wrench: [n, N, 6] of the air on each body, in its frame at its centre of mass.
        lift_axis, thrust_axis: unit vectors in the world. In wind: perpendicular to the stream (in the plane of flow
            and vertical), and against it; without wind: up, and forward (-x). The side force is along y, outboard.
        kinetic, elastic, gravitational: [n] energies, J; gravitational is zero at z = 0.
        solution: how the beat was solved; None for a motion that came from elsewhere.
    """

    phase: Array
    crossing: float
    motors: tuple[Motor, Motor]
    connectors: tuple[ConnectorLoad, ...]
    sections: tuple[Section, ...]
    strips: tuple[Strip, ...]
    air_wrench: Array
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
        return np.asarray(sum(connector.dissipated for connector in self.connectors))

    @property
    def balance(self) -> Balance:
        """Averages over the beat of the powers through the ports."""
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
        """By both motors, W."""
        return self.front_motor + self.rear_motor

    @property
    def closing(self) -> float:
        """Supplied less dissipated less given to the air, W; zero but for the integrator and the last transients."""
        return self.supplied - self.dissipated - self.to_air

    @property
    def relative_closing(self) -> float:
        """The closing error relative to what passes through: all that enters on the mean; 0 where nothing does."""
        entering = max(self.supplied, 0.0) + max(-self.to_air, 0.0)
        return self.closing / entering if entering > 0 else 0.0


def from_motion(
    structure: Structure, group: Lanes, condition: Condition, motion: State, crossing: float = 0.0
) -> Outputs:
    """Outputs of ``motion`` (R [n, N+2, 9], p [n, N+2, 3], V [n, N+2, 6]) of the one individual in ``group``."""
    n, count = len(motion.V), len(structure.bodies)
    sums = _Sums(structure, n)
    for rows, state in _groups(motion):
        _connectors(structure, group, state, sums, rows)
        _air(structure, group, condition, state, sums, rows)
        _energies(structure, condition, state, sums, rows)
    return Outputs(
        phase=np.arange(n) / n,
        crossing=crossing,
        motors=(_motor(motion, sums, count), _motor(motion, sums, count + 1)),
        connectors=_named(structure, sums),
        sections=_sections(structure, motion, sums),
        strips=_strips(structure, sums),
        air_wrench=sums.air_wrench,
        lift_axis=np.array([-np.sin(_incidence(condition)), 0.0, np.cos(_incidence(condition))]),
        thrust_axis=-np.array([np.cos(_incidence(condition)), 0.0, np.sin(_incidence(condition))]),
        kinetic=sums.kinetic,
        elastic=sums.stored.sum(axis=1),
        gravitational=sums.gravitational,
    )


class _Sums:
    """What is collected over the groups of instants."""

    def __init__(self, structure: Structure, n: int) -> None:
        bodies, connectors, strips = len(structure.bodies), len(structure.connectors), len(structure.wiring.area)
        self.wrench, self.twist = np.zeros((n, connectors, 6)), np.zeros((n, connectors, 6))
        self.lost, self.stored = np.zeros((n, connectors)), np.zeros((n, connectors))
        self.rod_moment = np.zeros((n, bodies + 2))
        self.air_wrench = np.zeros((n, bodies, 6))
        self.strip_force, self.strip_power = np.zeros((n, strips, 3)), np.zeros((n, strips))
        self.kinetic, self.gravitational = np.zeros(n), np.zeros(n)


def _groups(motion: State) -> Iterator[tuple[npt.NDArray[np.int64], State]]:
    """Instants by LANES: their numbers, and their state with the instant as the last axis, spare lanes filled."""
    n = len(motion.V)
    for start in range(0, n, LANES):
        rows = np.arange(start, min(start + LANES, n))
        filled = np.minimum(np.arange(start, start + LANES), n - 1)
        yield rows, State(*(np.ascontiguousarray(np.moveaxis(part[filled], 0, -1)) for part in motion))


def _connectors(structure: Structure, group: Lanes, state: State, sums: _Sums, rows: npt.NDArray[np.int64]) -> None:
    """One connector at a time, so that what the law adds up is that connector's."""
    w, kept = structure.wiring, len(rows)
    Q, d = np.zeros((len(w.first), 9, LANES)), np.zeros((len(w.first), 3, LANES))
    relative_pose(w.first, w.second, w.a, w.b, state.R, state.p, Q, d)
    for c in range(len(w.first)):
        one = slice(c, c + 1)
        wrench, lost, stored = np.zeros_like(state.V), np.zeros(LANES), np.zeros(LANES)
        connect(
            w.first[one], w.second[one], w.a[one], w.b[one], group.stiffness[one], group.damping[one],
            group.coupling[one], Q[one], d[one], state.V, wrench, lost, stored,
        )  # fmt: skip
        on_first = wrench[w.first[c]].T[:kept]
        e = (w.a[c] + d[c].T)[:kept]
        sums.wrench[rows, c, 3:] = -on_first[:, 3:]
        sums.wrench[rows, c, :3] = -on_first[:, :3] + np.cross(e, on_first[:, 3:])
        sums.twist[rows, c] = _relative_twist(state, w.first[c], w.second[c], w.b[c], Q[c], e)
        sums.lost[rows, c], sums.stored[rows, c] = lost[:kept], stored[:kept]
        if w.first[c] >= len(w.mass):
            sums.rod_moment[rows, w.first[c]] += on_first[:, 0]


def _relative_twist(state: State, first: int, second: int, b: Array, Q: Array, e: Array) -> Array:
    """[n, 6] of the second body against the first, in the first's axes at the point ``e`` [n, 3] from its centre."""
    n = len(e)
    turn = Q.T[:n].reshape(n, 3, 3)
    V, U = state.V[first].T[:n], state.V[second].T[:n]
    spin = np.einsum("tij,tj->ti", turn, U[:, :3]) - V[:, :3]
    carried = np.einsum("tij,tj->ti", turn, U[:, 3:] + np.cross(U[:, :3], b))
    return np.hstack([spin, carried - V[:, 3:] - np.cross(V[:, :3], e)])


def _air(
    structure: Structure,
    group: Lanes,
    condition: Condition,
    state: State,
    sums: _Sums,
    rows: npt.NDArray[np.int64],
) -> None:
    """One strip at a time."""
    w, kept = structure.wiring, len(rows)
    bodies, here = len(w.mass), setting(condition, len(sums.kinetic))
    wrench, unused = np.zeros_like(state.V), np.zeros((bodies, LANES))
    for s in range(len(w.area)):
        power, force = np.zeros(LANES), np.zeros((3, LANES))
        strip_forces(
            w.strip_start[s : s + 2], w.weight, w.centroid, w.area[s : s + 1],
            here.density, here.wind, group.coefficients, group.lift_share, group.lift_x, group.drag_share,
            group.drag_x, state.R, state.V, wrench, unused, power, force,
        )  # fmt: skip
        sums.strip_force[rows, s], sums.strip_power[rows, s] = force.T[:kept], power[:kept]
    sums.air_wrench[rows] = np.moveaxis(wrench, -1, 0)[:kept, :bodies]


def _energies(
    structure: Structure, condition: Condition, state: State, sums: _Sums, rows: npt.NDArray[np.int64]
) -> None:
    w, n = structure.wiring, len(structure.bodies)
    kinetic, potential = np.zeros(LANES), np.zeros(LANES)
    kinetic_and_height(w.mass, w.inertia, state.p[:n], state.V[:n], condition.gravity, kinetic, potential)
    sums.kinetic[rows], sums.gravitational[rows] = kinetic[: len(rows)], potential[: len(rows)]


def _motor(motion: State, sums: _Sums, rod: int) -> Motor:
    R, rate = motion.R[:, rod], motion.V[:, rod, 0]
    torque = -sums.rod_moment[:, rod]  # the rods have no mass: the motor holds what the connectors exert
    return Motor(np.arctan2(R[:, 7], R[:, 4]), rate, torque, torque * rate)


def body_names(structure: Structure) -> list[str]:
    """``strip.place``, strips from the root, places from the leading edge; then the two driving rods."""
    counts = structure.division.bodies
    return [f"{s}.{k}" for s, count in enumerate(counts, 1) for k in range(1, count + 1)] + list(RODS)


def _named(structure: Structure, sums: _Sums) -> tuple[ConnectorLoad, ...]:
    names, w, found = body_names(structure), structure.wiring, []
    strip = np.repeat(np.arange(len(structure.division.bodies)), structure.division.bodies)
    for c, connector in enumerate(structure.connectors):
        i, j = int(w.first[c]), int(w.second[c])
        kind: Kind = "root" if i >= len(strip) else "spanwise" if strip[i] != strip[j] else "chordwise"
        name = names[i] if kind == "root" else f"{kind} {names[i]}-{names[j]}"
        series = (sums.wrench[:, c], sums.twist[:, c], sums.lost[:, c], sums.stored[:, c])
        found.append(ConnectorLoad(name, kind, (names[i], names[j]), connector.point, *series))
    return tuple(found)


def _strips(structure: Structure, sums: _Sums) -> tuple[Strip, ...]:
    edges = structure.planform.strips(structure.division)
    return tuple(
        Strip(
            f"strip {s + 1}",
            (float(edges[s]), float(edges[s + 1])),
            sums.strip_force[:, s],
            sums.strip_power[:, s],
        )
        for s in range(len(edges) - 1)
    )


def _sections(structure: Structure, motion: State, sums: _Sums) -> tuple[Section, ...]:
    """The root and every border between strips."""
    w, starts = structure.wiring, structure.wiring.strip_start
    edges = structure.planform.strips(structure.division)
    R = motion.R.reshape(*motion.R.shape[:2], 3, 3)
    found = []
    for s in range(len(starts) - 1):
        inside = (w.second >= starts[s]) & (w.second < starts[s + 1])
        through = np.flatnonzero(inside & ((w.first < starts[s]) | (w.first >= len(w.mass))))
        turn = R[:, w.first[through]]
        force = np.einsum("tcij,tcj->tci", turn, sums.wrench[:, through, 3:])
        moment = np.einsum("tcij,tcj->tci", turn, sums.wrench[:, through, :3])
        second = w.second[through]
        point = motion.p[:, second] + np.einsum("tcij,cj->tci", R[:, second], w.b[through])
        moment = moment + np.cross(point - point.mean(axis=1, keepdims=True), force)
        body = slice(starts[s], starts[s + 1])
        axes = _nearest_rotation(np.einsum("tnij,n->tij", R[:, body], w.weight[body]))
        both = np.stack([moment.sum(axis=1), force.sum(axis=1)], axis=1)
        wrench = np.einsum("tij,tki->tkj", axes, both).reshape(len(R), 6)
        name = "root" if s == 0 else f"strips {s}-{s + 1}"
        found.append(Section(name, float(edges[s]), wrench))
    return tuple(found)


def _nearest_rotation(mean: Array) -> Array:
    """Rotations [n, 3, 3] nearest to mean rotation matrices: the orthogonal factor of their polar decomposition."""
    U, _, Vt = np.linalg.svd(mean)
    return np.asarray(U @ Vt)


def _incidence(condition: Condition) -> float:
    """Of the stream, rad; without wind the axes are those of the world."""
    return condition.angle_of_attack if condition.airspeed > 0 else 0.0
