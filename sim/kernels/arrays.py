"""Named tuples of the arrays that enter and leave the kernels, with their shapes; W individuals are one group."""

from __future__ import annotations

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.lanes.memory import aligned, several

STAGES = 6
# Ports through which power enters the wing.
DAMPERS, FRONT_MOTOR, REAR_MOTOR, AIR, PORTS = 0, 1, 2, 3, 4
# The flow of a strip, input of the laws of the air.
(
    CHORD_X, CHORD_Y, CHORD_Z,  # unit vector from leading to trailing edge, in the world
    NORMAL_X, NORMAL_Y, NORMAL_Z,  # unit vector out of the upper side
    PLACE_X, PLACE_Y, PLACE_Z,  # of the strip's centroid in the world, m; only for laws of effects
    STREAM_C, STREAM_N,  # velocity of the air relative to the strip, m/s
    SPEED, ALPHA, FORWARD,  # its magnitude; the angle of attack; 1 in flow from ahead, -1 from behind
    PITCH_RATE,  # of the strip about the span, nose up, rad/s
    FLOW,
) = range(16)  # fmt: skip
# Results of the laws of the air; forces are these times density times area / 2.
(
    CIRCULATION,  # speed times lift coefficient, m/s: a force across the stream, distributed like lift
    DRAG,  # speed times drag coefficient, m/s: a force along the stream, distributed like drag
    LIFT_SLOPE, DRAG_SLOPE,  # their derivatives by the angle of attack, for the linearisation
    PUSH_N, PUSH_C,  # m^2/s^2: force along normal and chord, uniform over the strip
    PUSH_M, PUSH_L,  # m^3/s^2: moment about the span, nose up, and about the chord, tip up, uniform
    LOADS,
) = range(9)  # fmt: skip
# Derivatives of each state of an effect that the step needs (wingfit.sim.kernels.laws).
DECAY, DRIVE, PULL = range(3)
FRAME = 17  # numbers in a law's frame: places, parameters and states per place, then addresses
# Clock of a beat: drive phase now, that at the start of the step, and the method's term for explicit time dependence.
NOW, START, SHARE, CLOCK = range(4)  # rad
# Geometry of a strip.
AREA, MEAN_CHORD, WIDTH, STATION, GEOMETRY = range(5)  # m^2, m, m, part of the span from root to tip


class Wiring(NamedTuple):
    """Topology and geometry of a discretised wing, the same for all individuals.

    N bodies have the indices 0..N-1, the front and the rear driving rod N and N+1; there are C connectors, S strips and
    M markers. ``mass`` [N] (kg) and ``inertia`` [N, 9] (kg m^2, about the centre of mass, row by row) of the bodies.
    Connector c joins the point at ``a`` [C, 3] (m) from the centre of mass of body ``first`` [C] to the point at ``b``
    [C, 3] of body ``second`` [C]; connectors from index ``driven`` on start at a driving rod. ``lower`` and ``upper``
    [C] are the numbers of the connector's off-diagonal blocks in the matrix of a step
    (:func:`wingfit.sim.kernels.tangents.add_connectors`); ``order`` to ``fill`` describe how this matrix is factored
    (``wingfit.sim.solver.elimination``). ``strip_start``, ``weight``, ``centroid``: see
    :func:`wingfit.sim.kernels.air.strip_flow`, where ``strip_start`` is called ``start``; ``geometry`` [S, GEOMETRY] of
    the strips. ``markers`` [M, 3]: positions in the frames of the bodies ``carrier`` [M], m.
    """

    mass: Array
    inertia: Array
    first: Index
    second: Index
    lower: Index
    upper: Index
    driven: int
    a: Array
    b: Array
    order: Index
    start: Index
    below: Index
    row: Index
    products: Index
    product_start: Index
    fill: Index
    strip_start: Index
    weight: Array
    centroid: Array
    geometry: Array
    markers: Array
    carrier: Index


class Setting(NamedTuple):
    """Condition of W individuals: air density [W] (kg/m^3), wind [3, W] (m/s), gravity (m/s^2), step of time (s)."""

    density: Array
    wind: Array
    gravity: float
    step: float


class Laws(NamedTuple):
    """Compiled laws of the effects that are on: functions called by address (:mod:`wingfit.sim.kernels.laws`).

    ``strip``, ``connector`` [., 6], one row for each law: address of the law, number of its parameters, number of its
    states for each strip or connector, index of its first row in ``parameters`` [., W], index of its first state in
    :class:`State`; last, for strips whether it is also called BEFORE the flow is known (1 or 0), for connectors its
    first index in ``axes``. ``axes``: axis of each state of a connector, 0..5 as in the stiffness. ``size`` [Z]: factor
    from each of all Z states to metres of motion. ``point`` [., 5], one row for each law: address, number of
    parameters, number of points, index of its first row in ``parameters``, index of its first point among all P points,
    which lie on ``bodies`` [P] at ``arms`` [P, 3, W] from the centre of mass (m, body frame). ``motor`` [MOTOR, W] or
    empty: a compliant drive (:mod:`wingfit.sim.kernels.motor`), whose states are the last three.
    """

    strip: Index
    connector: Index
    point: Index
    axes: Index
    bodies: Index
    arms: Array
    parameters: Array
    size: Array
    motor: Array


class Lanes(NamedTuple):
    """Inputs that differ between the W individuals of a group.

    ``stiffness`` and ``damping`` [C, 6, W] of C connectors (rotation about x, y, z, then translation); air
    ``coefficients`` [4, W]; ``lift_share`` to ``drag_x`` [N, W]: how lift and drag are distributed to N bodies
    (:mod:`wingfit.sim.kernels.air`); ``hinge`` [9, W]: unit vector along the axis of the driving rods, then the
    position of the true hinge relative to the described one, in the rods' frame (m), then its position in the world
    (m). The remaining inputs are empty for most wings: ``coupling`` [C, 9, W], stiffness that couples rotation with
    translation; ``pairs`` [P, 3] of bodies (i, j) with the number of their matrix block, whose momenta are coupled by
    the mass matrices ``masses`` [P, 36, W], the first ``weighing`` of which have weight, while the others are added
    mass of the air; and ``laws`` of effects.
    """

    stiffness: Array
    damping: Array
    coefficients: Array
    lift_share: Array
    lift_x: Array
    drag_share: Array
    drag_x: Array
    hinge: Array
    coupling: Array
    pairs: Index
    masses: Array
    weighing: int
    laws: Laws


class State(NamedTuple):
    """Motion of N bodies and the two driving rods, which are last, of W individuals, and the effects' Z states.

    R [N+2, 9, W]: rotation from body to world; p [N+2, 3, W]: position in the world, m; V [N+2, 6, W]: twist (angular
    velocity, velocity) in body axes, rad/s and m/s; z [Z, W]. One individual's state has the same arrays without W.
    """

    R: Array
    p: Array
    V: Array
    z: Array


# Working arrays of one group of lanes; see :func:`new_work` for the shapes.
Work = namedtuple(
    "Work",
    "R p V z xi r_xi known U_xi U_V U_z wrench lead Q d Q0 d0 against blocks flow loads induced normal_damping drag0 "
    "V0 R0 lost stored air_power air_force z_rate z_tangent z_tangent0 z_known twist more more0 more_k more_d more_k0 "
    "more_d0 push rods clock place turn point_twist point_wrench point_k point_d drag strip_frames connector_frames "
    "point_frames parameters density wind",
)


class Trace(NamedTuple):
    """Results at the n steps of one beat of W individuals (M markers, N bodies).

    ``tracks`` [n, M, 3, W]: positions of the markers in the world, m; ``rods`` [n, 2, 6, W]: moment and force of the
    wing on the front and the rear driving rod, in the rod's axes (N m, N); ``air`` [n, 3, W]: force of the air on the
    wing in world axes, N; ``power`` [n, PORTS, W] into the wing through dampers, front motor, rear motor and air, W;
    ``energy`` [n, 3, W]: kinetic, elastic, gravitational, J. R, p, V, z: the motion of all bodies and rods [n, N+2, .,
    W] as in :class:`State`, or empty if not requested.
    """

    tracks: Array
    rods: Array
    air: Array
    power: Array
    energy: Array
    R: Array
    p: Array
    V: Array
    z: Array


def new_work(wiring: Wiring, setting: Setting, lanes: Lanes) -> Work:
    """Allocate the working arrays of W individuals, zero except for constants; store their addresses for the laws."""
    n, c, s = len(wiring.mass), len(wiring.first), len(wiring.geometry)
    z, laws = len(lanes.laws.size), lanes.laws
    motion, stages = (n + 2, 6), (STAGES, n + 2, 6)
    joints, points = (c if len(laws.connector) else 0, 6), len(laws.bodies)
    blocks = n + 2 * len(wiring.below) + c - wiring.driven
    scratch = several(
        {
            "R": (n + 2, 9), "p": (n + 2, 3), "V": motion, "z": (z,),
            "xi": motion, "r_xi": motion, "known": motion, "wrench": motion, "lead": motion,
            "U_xi": stages, "U_V": stages, "U_z": (STAGES, z),
            "Q": (c, 9), "d": (c, 3), "Q0": (c, 9), "d0": (c, 3), "blocks": (blocks, 36),
            "flow": (s, FLOW), "loads": (s, LOADS), "induced": (s if len(laws.strip) else 0, 3),
            "normal_damping": (n,), "drag0": (n,), "V0": motion, "R0": (n + 2, 9),
            "lost": (), "stored": (), "air_power": (), "air_force": (3,),
            "z_rate": (z,), "z_tangent": (3, z), "z_tangent0": (3, z), "z_known": (z,),
            "twist": joints, "more": joints, "more0": joints, "push": joints,
            "more_k": joints, "more_d": joints, "more_k0": joints, "more_d0": joints,
            "rods": (2, 3), "clock": (CLOCK,),
            "place": (points, 3), "turn": (points, 9), "point_twist": (points, 6), "point_wrench": (points, 6),
            "point_k": (points, 36), "point_d": (points, 36), "drag": (points, 36),
        }
    )  # fmt: skip
    work = Work(
        **scratch,
        against=aligned(-lanes.damping),
        strip_frames=np.zeros((len(laws.strip), FRAME), np.int64),
        connector_frames=np.zeros((len(laws.connector), FRAME), np.int64),
        point_frames=np.zeros((len(laws.point), FRAME), np.int64),
        # referenced here because the frames contain their addresses
        parameters=laws.parameters,
        density=setting.density,
        wind=setting.wind,
    )
    _frame_laws(wiring, setting, laws, work)
    return work


def _frame_laws(wiring: Wiring, setting: Setting, laws: Laws, work: Work) -> None:
    """Fill the frame of every law in ``work``: three sizes, then the addresses of its arrays (:func:`_frame`)."""
    air = (work.flow, work.loads, work.induced, wiring.geometry, setting.density, setting.wind, work.clock)
    joints = (work.Q, work.d, work.twist, work.more, work.more_k, work.more_d, work.lost, work.stored)
    for k, row in enumerate(laws.strip):
        own = (laws.parameters[row[3] :], work.z[row[4] :], work.z_rate[row[4] :], work.z_tangent[DECAY, row[4] :])
        work.strip_frames[k] = _frame(len(wiring.geometry), row, (*own, *air))
    for k, row in enumerate(laws.connector):
        tangents = (work.z_tangent[kind, row[4] :] for kind in (DECAY, DRIVE, PULL))
        states = (work.z[row[4] :], work.z_rate[row[4] :], *tangents)
        work.connector_frames[k] = _frame(len(wiring.first), row, (laws.parameters[row[3] :], *states, *joints))
    points = (work.place, work.turn, work.point_twist, work.point_wrench, work.point_k, work.point_d)
    for k, row in enumerate(laws.point):
        own_points = (array[row[4] :] for array in points)
        arrays = (laws.parameters[row[3] :], *own_points, work.lost, work.stored, work.clock)
        work.point_frames[k] = _frame(int(row[2]), row, arrays)


def _frame(places: int, row: Index, arrays: tuple[Array, ...]) -> list[int]:
    """Return the FRAME integers of a law's frame: three sizes, then addresses of ``arrays``, padded with zeros.

    ``places``: number of strips, connectors or points; ``row``: the law's row in :class:`Laws`, which has the numbers
    of its parameters and of its states.
    """
    found = [places, int(row[1]), int(row[2]), *(array.ctypes.data for array in arrays)]
    return found + [0] * (FRAME - len(found))
