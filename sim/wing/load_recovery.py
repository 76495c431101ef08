"""Load recovery: loads, powers and energies of one wing from the motion of its bodies over one beat.

The forces are computed by the compiled functions of the integrator. Their vectors, which hold eight individuals
elsewhere, hold eight instants of one individual here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wingfit.records.array_types import Array, Index
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.air import strip_forces
from wingfit.sim.kernels.arrays import NOW, Lanes, Setting, State, Wiring, Work, new_work
from wingfit.sim.kernels.bodies import kinetic_and_height
from wingfit.sim.kernels.connectors import twists
from wingfit.sim.kernels.integrate import airflow, forces, point_forces
from wingfit.sim.kernels.lanes.memory import aligned
from wingfit.sim.kernels.masses import add_energies
from wingfit.sim.wing.outputs import ConnectorLoad, Kind, Motor, Outputs, Section, Strip
from wingfit.sim.wing.structure import Structure

_NORMAL_MOTION = [0, 1, 5]  # components of a twist that move air along a plate's normal: omega_x, omega_y, v_z
RODS = ("front rod", "rear rod")


def from_motion(scene: WingScene, motion: State, crossing: float = 0.0) -> Outputs:
    """Compute the outputs of one individual from its ``motion`` over a beat, at n equal steps.

    ``motion``: rotations R [n, N + 2, 9], positions p [n, N + 2, 3] and twists V [n, N + 2, 6] of N bodies and two
    rods, and the effects' states z [n, Z]. All lanes of ``scene`` must be this individual with its effects, since lanes
    are used for instants. ``crossing``: drive phase (beats) at which the recorded beat starts.
    """
    structure, n = scene.structure, len(motion.V)
    sums = _Sums(structure, n)
    parts = _Parts(structure.wiring, scene.setting(n), scene.frozen())
    groups = list(_groups(motion))
    for c in range(len(structure.connectors)):
        _connector(parts, c, groups, sums)
    _air_and_energies(parts, groups, sums)
    _added_mass_loads(parts, scene, motion, sums)
    incidence = scene.condition.angle_of_attack if scene.condition.airspeed > 0 else 0.0  # of the stream
    return Outputs(
        phase=np.arange(n) / n, crossing=crossing,
        motors=(_motor(parts, motion, sums, 0), _motor(parts, motion, sums, 1)),
        connectors=_named(structure, sums), sections=_sections(structure, motion, sums),
        strips=_strips(structure, sums), air_wrench=sums.air_wrench,
        held=sums.held, held_lost=sums.held_lost, held_stored=sums.held_stored,
        lift_axis=np.array([-np.sin(incidence), 0.0, np.cos(incidence)]),
        thrust_axis=-np.array([np.cos(incidence), 0.0, np.sin(incidence)]),
        kinetic=sums.kinetic, elastic=sums.stored.sum(axis=1) + sums.held_stored, gravitational=sums.gravitational,
    )  # fmt: skip


class _Sums:
    """Arrays for the results at all instants (first axis n), filled group by group; see :class:`Outputs`."""

    def __init__(self, structure: Structure, n: int) -> None:
        bodies, connectors, strips = len(structure.bodies), len(structure.connectors), len(structure.division.bodies)
        self.wrench, self.twist = np.zeros((n, connectors, 6)), np.zeros((n, connectors, 6))
        self.lost, self.stored = np.zeros((n, connectors)), np.zeros((n, connectors))
        self.on_rods = np.zeros((n, 2, 6))
        self.air_wrench, self.held = np.zeros((n, bodies, 6)), np.zeros((n, bodies, 6))
        self.held_lost, self.held_stored = np.zeros(n), np.zeros(n)
        self.strip_force, self.strip_power = np.zeros((n, strips, 3)), np.zeros((n, strips))
        self.kinetic, self.gravitational = np.zeros(n), np.zeros(n)


class _Parts(NamedTuple):
    """Inputs of the kernels: ``wiring`` of the wing, the condition ``here``, and ``lanes`` of the individual."""

    wiring: Wiring
    here: Setting
    lanes: Lanes

    def alone(self, c: int) -> tuple[_Parts, Index]:
        """Inputs for a massless wing whose only connector is ``c``, with the effects on this connector.

        Also returned: the indices of these effects' states.
        """
        w, group, none = self.wiring, self.lanes, np.zeros(0, np.int64)
        one, count = slice(c, c + 1), len(w.first)
        wiring = w._replace(
            mass=0 * w.mass, inertia=0 * w.inertia, first=w.first[one], second=w.second[one], a=w.a[one], b=w.b[one],
            driven=0, below=none, strip_start=np.zeros(1, np.int64), geometry=w.geometry[:0],
        )  # fmt: skip
        laws, rows, parameters, states = group.laws, [], none, none
        for function, given, kept, at, first, axes in laws.connector:
            rows.append([function, given, kept, len(parameters), len(states), axes])
            parameters = np.append(parameters, at + c + count * np.arange(given))
            states = np.append(states, first + c + count * np.arange(kept))
        own = laws._replace(
            strip=laws.strip[:0], connector=np.array(rows, np.int64).reshape(-1, 6), size=laws.size[states],
            parameters=aligned(laws.parameters[parameters]), motor=laws.motor[:0], point=laws.point[:0],
            bodies=laws.bodies[:0], arms=laws.arms[:0],
        )  # fmt: skip
        lanes = group._replace(
            stiffness=group.stiffness[one], damping=group.damping[one], coupling=group.coupling[one],
            pairs=group.pairs[:0], masses=group.masses[:0], weighing=0, laws=own,
        )  # fmt: skip
        return _Parts(wiring, self.here, lanes), states


def _groups(motion: State) -> Iterator[tuple[Index, State]]:
    """Split the motion into groups of LANES instants; yield the indices of each group and its state.

    The last axis of the state is the instant. In the last group, unused lanes repeat the last instant.
    """
    n = len(motion.V)
    for start in range(0, n, LANES):
        rows = np.arange(start, min(start + LANES, n))
        filled = np.minimum(np.arange(start, start + LANES), n - 1)
        yield rows, State(*(np.ascontiguousarray(np.moveaxis(part[filled], 0, -1)) for part in motion))


def _put(work: Work, state: State) -> None:
    for array, value in zip((work.R, work.p, work.V, work.z), state, strict=True):
        array[:] = value


def _connector(parts: _Parts, c: int, groups: list[tuple[Index, State]], sums: _Sums) -> None:
    """Set the loads of connector ``c`` in ``sums``: the integrator's forces on a wing that has no other connector.

    ``groups`` as from :func:`_groups`.
    """
    alone, own = parts.alone(c)
    work, w, twist = new_work(*alone), alone.wiring, np.zeros((1, 6, LANES))
    first = int(w.first[0])
    for rows, state in groups:
        count = len(rows)
        _put(work, state._replace(z=state.z[own]))
        forces(*alone, work)
        twists(w.first, w.second, w.a, w.b, work.Q, work.d, work.V, twist)
        on_first, e = work.wrench[first].T[:count], (w.a[0] + work.d[0].T)[:count]
        sums.wrench[rows, c, 3:] = -on_first[:, 3:]
        sums.wrench[rows, c, :3] = -on_first[:, :3] + np.cross(e, on_first[:, 3:])
        sums.twist[rows, c] = twist[0].T[:count]
        sums.lost[rows, c], sums.stored[rows, c] = work.lost[:count], work.stored[:count]
        if first >= len(w.mass):
            sums.on_rods[rows, first - len(w.mass)] += on_first


def _air_and_energies(parts: _Parts, groups: list[tuple[Index, State]], sums: _Sums) -> None:
    """Set air loads, loads of effects at points of the wing, kinetic and gravitational energy in ``sums``.

    The flow is computed for the whole wing at once, the forces strip by strip. ``groups`` as from :func:`_groups`.
    """
    w, here, group = parts
    work, n, solid = new_work(*parts), len(w.mass), group._replace(pairs=group.pairs[: group.weighing])
    kinetic, height = np.zeros(LANES), np.zeros(LANES)
    for rows, state in groups:
        count = len(rows)
        _put(work, state)
        work.clock[NOW, :count] = 2 * np.pi * rows / len(sums.kinetic)
        airflow(w, here, group, work)
        work.wrench[:] = 0.0
        for s in range(len(w.geometry)):
            one = slice(s, s + 1)
            power, force = np.zeros(LANES), np.zeros((3, LANES))
            strip_forces(
                w.strip_start[s : s + 2], w.weight, w.centroid, w.geometry[one], here.density,
                group.lift_share, group.lift_x, group.drag_share, group.drag_x,
                work.flow[one], work.loads[one], len(group.laws.strip) > 0,
                work.R, work.V, work.wrench, work.normal_damping, power, force,
            )  # fmt: skip
            sums.strip_force[rows, s], sums.strip_power[rows, s] = force.T[:count], power[:count]
        sums.air_wrench[rows] = np.moveaxis(work.wrench, -1, 0)[:count, :n]
        for array in (work.wrench, work.lost, work.stored):
            array[:] = 0.0
        point_forces(group, work)
        sums.held[rows] = np.moveaxis(work.wrench, -1, 0)[:count, :n]
        sums.held_lost[rows], sums.held_stored[rows] = work.lost[:count], work.stored[:count]
        kinetic_and_height(w.mass, w.inertia, work.p, work.V, here.gravity, kinetic, height)
        add_energies(solid, here, work, kinetic, height)
        sums.kinetic[rows], sums.gravitational[rows] = kinetic[:count], height[:count]


def _added_mass_loads(parts: _Parts, scene: WingScene, motion: State, sums: _Sums) -> None:
    """Add to ``sums`` the load -N q' of the air's added mass N on the wing (:mod:`wingfit.sim.kernels.masses`).

    The integrator treats it as inertia. q' is the time derivative, by a Fourier series of the beat, of the bodies'
    velocity through the air along and about their axes in ``_NORMAL_MOTION``.
    """
    group, structure = parts.lanes, scene.structure
    if len(group.pairs) == group.weighing:
        return
    n, bodies = motion.V.shape[0], len(structure.bodies)
    turn = motion.R[:, :bodies].reshape(n, bodies, 3, 3)
    q = motion.V[:, :bodies, _NORMAL_MOTION].copy()
    q[..., 2] -= turn[..., :, 2] @ parts.here.wind[:, 0]
    momentum = np.zeros_like(q)
    for (i, j, _), block in zip(group.pairs[group.weighing :], group.masses[group.weighing :, :, 0], strict=True):
        momentum[:, i] += q[:, j] @ block.reshape(6, 6)[np.ix_(_NORMAL_MOTION, _NORMAL_MOTION)].T
    order = 2j * np.pi * scene.condition.flap_frequency * np.arange(n // 2 + 1)
    wrench = np.zeros((n, bodies, 6))
    wrench[..., _NORMAL_MOTION] = -np.fft.irfft(np.fft.rfft(momentum, axis=0) * order[:, None, None], n, axis=0)
    force = turn[..., 2] * wrench[..., 5:]
    power = (wrench * motion.V[:, :bodies]).sum(axis=2)
    starts = structure.wiring.strip_start[:-1]
    sums.air_wrench += wrench
    sums.strip_force += np.add.reduceat(force, starts, axis=1)
    sums.strip_power += np.add.reduceat(power, starts, axis=1)


def _motor(parts: _Parts, motion: State, sums: _Sums, rod: int) -> Motor:
    """Motion and load of the motor of driving rod ``rod`` (0 front, 1 rear), about the hinge axis with its effects.

    The rods have no mass, so that the motor's torque balances the connectors.
    """
    hinge, row = parts.lanes.hinge[:, 0], len(parts.wiring.mass) + rod
    axis, off = hinge[:3], hinge[3:6]
    R, rate = motion.R[:, row].reshape(-1, 3, 3), motion.V[:, row, :3] @ axis
    turned = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1) @ axis
    angle = np.arctan2(turned, np.trace(R, axis1=1, axis2=2) - 1.0)
    moment, force = sums.on_rods[:, rod, :3], sums.on_rods[:, rod, 3:]
    torque = -(moment - np.cross(off, force)) @ axis
    return Motor(angle, rate, torque, torque * rate)


def body_names(structure: Structure) -> list[str]:
    """Names ``strip.body`` of the bodies, both counted from 1, then of the driving rods.

    Strips are counted from the root, bodies of a strip from the leading edge.
    """
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
        Strip(f"strip {s + 1}", (float(edges[s]), float(edges[s + 1])), sums.strip_force[:, s], sums.strip_power[:, s])
        for s in range(len(edges) - 1)
    )


def _sections(structure: Structure, motion: State, sums: _Sums) -> tuple[Section, ...]:
    """Loads through the root and through every boundary between strips, from ``sums``."""
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
    """Rotations [n, 3, 3] nearest to ``mean`` [n, 3, 3]: the orthogonal factors of its polar decomposition."""
    U, _, Vt = np.linalg.svd(mean)
    return np.asarray(U @ Vt)
