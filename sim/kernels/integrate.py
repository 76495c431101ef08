"""Rosenbrock integration of the wing over a beat, for LANES individuals at a time.

The method is RODAS4P2 (Steinebach, *Improvement of Rosenbrock-Wanner Method RODASP*, 2020): six stages, fourth order,
L-stable, stiffly accurate, without order reduction on stiff problems and robust to an inexact Jacobian. The Jacobian is
exact except for the air, of which it contains the damping along the normal. Driving rods are bodies with prescribed
acceleration, so that the stages are consistent for the stiff connectors at the root; their pose is set to the exact
profile of the drive at the start of each step. The arguments ``wiring``, ``setting``, ``lanes``, ``state`` and
``trace`` are described in :mod:`wingfit.sim.kernels.arrays`; ``work`` holds the working arrays, W is the number of
individuals.
"""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Mask
from wingfit.sim.kernels import LANES, arrays
from wingfit.sim.kernels.air import strip_flow, strip_forces
from wingfit.sim.kernels.arrays import STAGES, Lanes, Setting, State, Trace, Wiring, Work
from wingfit.sim.kernels.bodies import inertial, kinetic_and_height, move, track
from wingfit.sim.kernels.connectors import connect, relative_pose, tangent, twists
from wingfit.sim.kernels.jit import allocating, kernel
from wingfit.sim.kernels.lanes.lanewise import cosine_and_sine
from wingfit.sim.kernels.lanes.matrices import cross, less, store_matrix, store_vector, times
from wingfit.sim.kernels.lanes.vector import load, load0, load1, load3, store, store1
from wingfit.sim.kernels.laws import AFTER, BEFORE, call
from wingfit.sim.kernels.linear import factor, solve, subtract_column
from wingfit.sim.kernels.masses import add_energies, add_mass_blocks, add_mass_terms, add_momentum
from wingfit.sim.kernels.motor import motor_rates, rods_of
from wingfit.sim.kernels.points import add_point_blocks, add_point_terms, add_point_wrenches, follow_points
from wingfit.sim.kernels.stages import combine, coupled_rates, keep_stage, place_rod
from wingfit.sim.kernels.states import combine_states, finish_states, keep_tangents, start_states
from wingfit.sim.kernels.tangents import add_connectors, add_own_terms, start_blocks

GAMMA = 0.25
NODES = np.array([0.0, 0.75, 0.321448134013046, 0.519745732277726, 1.0, 1.0])
# Sum of the gammas of each stage: factor on the time derivative of the drive's acceleration.
SLOPES = np.array([0.25, -0.5, -0.189532918363016, 0.085612108792769, 0.0, 0.0])
# In the variables U = Gamma k (Hairer and Wanner, Solving ODEs II, IV.7) no product with the Jacobian is needed: a
# stage is at y + sum of STAGE U, and its right-hand side contains the sum of COUPLING U / h. The last two stages and
# the result are the state of the stage before plus its U.
STAGE = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0, 0.0, 0.0],
        [0.906377755268814, -0.189707390391685, 0.0, 0.0, 0.0],
        [3.758617027739064, 1.161741776019525, -0.849258085312803, 0.0, 0.0],
        [7.089566927282776, 4.573591406461604, -8.423496976860259, -0.959280113459775, 0.0],
        [7.089566927282776, 4.573591406461604, -8.423496976860259, -0.959280113459775, 1.0],
    ]
)
COUPLING = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [-12.0, 0.0, 0.0, 0.0, 0.0],
        [-6.354581592719008, 0.338972550544623, 0.0, 0.0, 0.0],
        [-8.575016317114033, -7.606483992117508, 12.224997650124820, 0.0, 0.0],
        [-5.888975457523102, -8.157396617841821, 24.805546872612922, 12.790401512796979, 0.0],
        [-4.408651676063871, -6.692003137674639, 24.625568527593117, 16.627521966636085, -5.714285714285718],
    ]
)

MAX_ROTATION = 1.0  # rad in one step; above, the individual has diverged


@kernel
def set_rods(rods: Array, hinge: Array, state: State) -> None:
    """Set the pose and twist of both driving rods in ``state`` from their angle and rate ``rods`` [2, 3, W].

    ``rods`` holds angle (rad), rate and acceleration of the front and rear rod; ``hinge`` [9, W]: the axis u, the
    offset ``off`` of the true hinge in the rods' frame, and its ``place`` in the world (m). R = c I + s u~ + (1 - c) u
    u^T, c and s being cosine and sine of the angle; the rods' frame moves on a circle about the hinge: p = place - R
    off, v = -u rate x off.
    """
    n = len(state.R) - 2
    u, off = (load1(hinge, 0), load1(hinge, 1), load1(hinge, 2)), (load1(hinge, 3), load1(hinge, 4), load1(hinge, 5))
    for k in range(2):
        c, s = cosine_and_sine(load(rods, k, 0))
        rate = load(rods, k, 1)
        a = (u[0] * (1.0 - c), u[1] * (1.0 - c), u[2] * (1.0 - c))
        R = (
            c + a[0] * u[0], a[0] * u[1] - s * u[2], a[0] * u[2] + s * u[1],
            a[1] * u[0] + s * u[2], c + a[1] * u[1], a[1] * u[2] - s * u[0],
            a[2] * u[0] - s * u[1], a[2] * u[1] + s * u[0], c + a[2] * u[2],
        )  # fmt: skip
        x, y, z = cross(u, off)
        store_matrix(state.R, n + k, R)
        store_vector(state.p, n + k, 0, less((load1(hinge, 6), load1(hinge, 7), load1(hinge, 8)), times(R, off)))
        store_vector(state.V, n + k, 0, (u[0] * rate, u[1] * rate, u[2] * rate))
        store_vector(state.V, n + k, 3, (-(x * rate), -(y * rate), -(z * rate)))


@kernel
def forces(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work) -> None:
    """Compute ``work.wrench`` of all bodies and rods and ``work.z_rate`` of the effects' states.

    Pose, twist and states are read from ``work``; powers and energies (``lost``, ``stored``, ``air_power``) and the
    force of the air are also set.
    """
    n = len(wiring.mass)
    w_, Q, d, laws = work.wrench, work.Q, work.d, lanes.laws
    relative_pose(wiring.first, wiring.second, wiring.a, wiring.b, work.R, work.p, Q, d)
    inertial(wiring.mass, wiring.inertia, work.R, work.V, setting.gravity, w_)
    w_[n:] = 0.0
    work.lost[:] = 0.0
    work.stored[:] = 0.0
    work.air_power[:] = 0.0
    work.air_force[:] = 0.0
    if len(lanes.pairs):
        add_momentum(lanes, setting, work.R, work.V, w_)
    if len(laws.connector):
        twists(wiring.first, wiring.second, wiring.a, wiring.b, Q, d, work.V, work.twist)
        work.more[:] = 0.0
        work.more_k[:] = 0.0
        work.more_d[:] = 0.0
        for k in range(len(laws.connector)):
            call(laws.connector[k, 0], work.connector_frames[k].ctypes.data, AFTER)
    connect(
        wiring.first, wiring.second, wiring.a, wiring.b, lanes.stiffness, lanes.damping,
        lanes.coupling, work.more, Q, d, work.V, w_, work.lost, work.stored,
    )  # fmt: skip
    airflow(wiring, setting, lanes, work)
    strip_forces(
        wiring.strip_start, wiring.weight, wiring.centroid, wiring.geometry, setting.density,
        lanes.lift_share, lanes.lift_x, lanes.drag_share, lanes.drag_x,
        work.flow, work.loads, len(laws.strip) > 0,
        work.R, work.V, w_, work.normal_damping, work.air_power, work.air_force,
    )  # fmt: skip
    if len(laws.point):
        point_forces(lanes, work)


@kernel
def point_forces(lanes: Lanes, work: Work) -> None:
    """Call the effects' laws that act at points of bodies, and add their wrenches to ``work.wrench``.

    The laws add the power that they dissipate and the energy that they store to ``work.lost`` and ``work.stored``.
    """
    laws = lanes.laws
    work.point_wrench[:] = 0.0
    work.point_k[:] = 0.0
    work.point_d[:] = 0.0
    follow_points(laws, work)
    for k in range(len(laws.point)):
        call(laws.point[k, 0], work.point_frames[k].ctypes.data, AFTER)
    add_point_wrenches(laws, work)


@kernel
def airflow(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work) -> None:
    """Set the flow ``work.flow`` and loads ``work.loads`` of all strips, including the effects' laws of the air."""
    laws = lanes.laws
    work.induced[:] = 0.0
    for k in range(len(laws.strip)):
        if laws.strip[k, 5]:
            call(laws.strip[k, 0], work.strip_frames[k].ctypes.data, BEFORE)
    strip_flow(
        wiring.strip_start, wiring.weight, wiring.centroid, setting.wind, lanes.coefficients,
        work.induced, work.R, work.p, work.V, work.flow, work.loads,
    )  # fmt: skip
    for k in range(len(laws.strip)):
        call(laws.strip[k, 0], work.strip_frames[k].ctypes.data, AFTER)


@allocating
def record_step(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work, trace: Trace, t: int) -> None:
    """Store motion, rods' load, air force, powers and energies at the start of step ``t`` in ``trace``.

    The values at the stages within a step are not stored, because stiff springs are far from their true values there.
    """
    n, power = len(wiring.mass), trace.power[t]
    store1(power, arrays.DAMPERS, -load0(work.lost))
    store1(power, arrays.AIR, load0(work.air_power))
    for rod in range(2):
        given = load(work.wrench, n + rod, 0) * load(work.V, n + rod, 0)
        for i in range(1, 6):
            given += load(work.wrench, n + rod, i) * load(work.V, n + rod, i)
        store1(power, arrays.FRONT_MOTOR + rod, -given)
    trace.rods[t] = work.wrench[n:]
    trace.air[t] = work.air_force
    track(wiring.markers, wiring.carrier, work.R, work.p, trace.tracks[t])
    energy = trace.energy[t]
    kinetic_and_height(wiring.mass, wiring.inertia, work.p, work.V, setting.gravity, energy[0], energy[2])
    energy[1] = work.stored
    if len(lanes.pairs):
        add_energies(lanes, setting, work, energy[0], energy[2])
    if len(trace.R):
        trace.R[t] = work.R
        trace.p[t] = work.p
        trace.V[t] = work.V
        trace.z[t] = work.z


@allocating
def linearise(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work) -> None:
    """Assemble and factor the matrix S of the equations of all stages of a step, at the start of the step.

    S is defined in ``wingfit.sim.kernels.tangents``. The pose, the twist and the derivatives for which it holds are
    copied to the arrays of ``work`` whose names end in 0.
    """
    hg = setting.step * GAMMA
    work.Q0[:] = work.Q
    work.d0[:] = work.d
    work.drag0[:] = work.normal_damping
    work.V0[:] = work.V
    work.R0[:] = work.R
    work.more0[:] = work.more
    work.more_k0[:] = work.more_k
    work.more_d0[:] = work.more_d
    if len(work.z):
        keep_tangents(lanes.laws, wiring, hg, work)
    for c in range(len(work.more_d0)):
        for i in range(6):
            store(work.against, c, i, -load(lanes.damping, c, i) - load(work.more_d0, c, i))
    start_blocks(wiring.mass, wiring.inertia, work.drag0, work.R, work.V, setting.gravity, hg, wiring.fill, work.blocks)
    add_connectors(
        wiring.first, wiring.second, wiring.lower, wiring.upper, wiring.a, wiring.b,
        lanes.stiffness, lanes.damping, lanes.coupling, work.more0, work.more_k0, work.more_d0,
        work.Q0, work.d0, work.V, hg, work.blocks,
    )  # fmt: skip
    if len(lanes.pairs):
        add_mass_blocks(lanes, setting, work.R, work.V, hg, work.blocks)
    if len(lanes.laws.point):
        add_point_blocks(lanes.laws, work, hg)
    factor(wiring.order, wiring.start, wiring.below, wiring.products, wiring.product_start, work.blocks)


@kernel
def solve_stage(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work, rods: Array, stage: int) -> None:
    """Solve one stage for the increments U_V (twists), U_xi (local coordinates) and U_z (effects' states).

    ``rods`` [2, 3, W]: angle, rate and acceleration of the driving rods at the stage. With the right-hand side f of the
    equations and r = f + sum of COUPLING U / h (h: step), Y = U_xi / (h gamma) solves S Y = M (r_V + r_xi / (h gamma))
    - dW/dV r_xi, and U_V = (I - h gamma A) Y - r_xi; A, M, S and W are those of :mod:`wingfit.sim.kernels.tangents`.
    The rods' Y is known, their acceleration being prescribed.
    """
    n, hg, k = len(wiring.mass), setting.step * GAMMA, wiring.driven
    r_xi, wrench, known = work.r_xi, work.wrench, work.known
    coupled_rates(work.xi, work.V, work.U_xi, work.U_V, COUPLING[stage], stage, 1.0 / setting.step, r_xi, work.lead)
    for rod in range(n, n + 2):
        place_rod(rod, load(rods, rod - n, 2), hg, lanes.hinge, work.V0, work.lead, r_xi, known)
    add_own_terms(wiring.mass, wiring.inertia, work.drag0, work.V0, 1.0 / hg, work.lead, r_xi, wrench)
    if len(lanes.pairs):
        add_mass_terms(lanes, setting, work.R0, work.V0, 1.0 / hg, work.lead, r_xi, wrench)
    if len(lanes.laws.point):
        add_point_terms(lanes.laws.bodies, work.drag, r_xi, wrench)
    tangent(wiring.first, wiring.second, wiring.a, wiring.b, work.against, work.Q0, work.d0, r_xi, wrench)
    if len(work.z):
        start_states(wiring, lanes.laws, setting.step, COUPLING[stage], stage, work)
    for c in range(k, len(wiring.first)):
        subtract_column(wiring.second[c], wiring.lower[c], work.blocks, known, wiring.first[c], wrench)
    solve(wiring.order, wiring.start, wiring.below, wiring.row, work.blocks, wrench)
    for i in range(n):
        for j in range(6):
            store(known, i, j, load(wrench, i, j))
    keep_stage(known, r_xi, work.V0, hg, work.U_xi[stage], work.U_V[stage])
    if len(work.z):
        finish_states(wiring, lanes.laws, work, stage)


@kernel
def _to_stage(work: Work, state: State, stage: int) -> None:
    """Set local coordinates, twist, effects' states and pose in ``work`` to the point where ``stage`` is evaluated.

    ``state``: the motion at the start of the step; ``stage`` = STAGES gives the end of the step.
    """
    if stage < STAGES - 1:
        combine(0.0, state.V, work.U_xi, STAGE[stage], stage, work.xi)
        combine(1.0, state.V, work.U_V, STAGE[stage], stage, work.V)
        combine_states(state.z, work.U_z, STAGE[stage], stage, work.z)
    else:
        for i in range(work.xi.shape[0]):
            for k in range(6):
                store(work.xi, i, k, load(work.xi, i, k) + load3(work.U_xi, stage - 1, i, k))
                store(work.V, i, k, load(work.V, i, k) + load3(work.U_V, stage - 1, i, k))
        for i in range(len(work.z)):
            store1(work.z, i, load1(work.z, i) + load(work.U_z, stage - 1, i))
    move(state.R, state.p, work.xi, work.R, work.p)


@kernel
def _set_clock(clock: Array, turn: float, t: int, stage: int) -> None:
    """Set in ``clock`` the drive phase of a stage of step ``t``, which the laws read; a step takes ``turn`` (rad)."""
    clock[arrays.NOW] = turn * (t + NODES[stage])
    clock[arrays.START] = turn * t
    clock[arrays.SHARE] = turn * SLOPES[stage]


@allocating
def finish_step(work: Work, state: State, alive: Mask) -> None:
    """Set ``state`` to the end of the step, and ``alive`` [W] to False where a body turned too far or became NaN."""
    _to_stage(work, state, STAGES)
    state.R[:] = work.R
    state.p[:] = work.p
    state.V[:] = work.V
    state.z[:] = work.z
    for i in range(len(work.xi)):
        for w in range(LANES):
            x, y, z = work.xi[i, 0, w], work.xi[i, 1, w], work.xi[i, 2, w]
            if not x * x + y * y + z * z < MAX_ROTATION**2:
                alive[w] = False


@allocating
def advance(
    wiring: Wiring, setting: Setting, lanes: Lanes, drive: Array, work: Work, state: State, trace: Trace, alive: Mask
) -> None:
    """Integrate one beat of n steps from ``state``, in place, and store the motion at every step in ``trace``.

    ``drive`` [n, STAGES, 2, 3, W]: angle, rate and acceleration of both rods at the stages of every step (six columns
    instead of three for a compliant drive, see :func:`wingfit.sim.kernels.motor.rods_of`). Angle and rate are used at
    the start of the step only; within the step they follow from the acceleration. Individuals whose bodies rotate more
    than MAX_ROTATION in a step, or become NaN, are set to False in ``alive`` [W]; their further results are
    meaningless.
    """
    for t in range(len(drive)):
        rods = drive[t, 0]
        if len(lanes.laws.motor):
            rods_of(drive[t, 0], state.z, work.z_rate, work.rods)
            rods = work.rods
        set_rods(rods, lanes.hinge, state)
        work.xi[:] = 0.0
        work.R[:] = state.R
        work.p[:] = state.p
        work.V[:] = state.V
        work.z[:] = state.z
        for stage in range(STAGES):
            if stage > 0:
                _to_stage(work, state, stage)
            _set_clock(work.clock, 2.0 * np.pi / len(drive), t, stage)
            forces(wiring, setting, lanes, work)
            if len(lanes.laws.motor):
                motor_rates(lanes.laws.motor, work)
            if stage == 0:
                record_step(wiring, setting, lanes, work, trace, t)
                linearise(wiring, setting, lanes, work)
            rods = drive[t, stage]
            if len(lanes.laws.motor):
                rods_of(drive[t, stage], work.z, work.z_rate, work.rods)
                rods = work.rods
            solve_stage(wiring, setting, lanes, work, rods, stage)
        finish_step(work, state, alive)
