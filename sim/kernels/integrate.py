"""Rosenbrock-W integration of the wing over its beats, eight individuals at a time.

The method is ROS34PW2 (Rang and Angermann, BIT 45, 2005): four stages, third order for any approximation of the
Jacobian, L-stable, stiffly accurate. That freedom lets the linearisation keep only what makes it symmetric positive
definite (inertia, material stiffness, dampers, the air's normal damping). Driving rods are bodies with a prescribed
acceleration, so that stiff roots see consistent stages; their pose is set to the exact profile at each step's start.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim.kernels import LANES
from sim.kernels.air import strip_forces
from sim.kernels.bodies import inertial, kinetic_and_height, local_rate, move, times_mass, track
from sim.kernels.connectors import connect, relative_pose, tangent
from sim.kernels.jit import kernel
from sim.kernels.linear import add_connectors, factor, solve, start_blocks
from sim.kernels.vector import load, load0, load3, store, store1, store3

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

GAMMA = 4.3586652150845900e-01
ALPHA = np.array(
    [
        [0.0, 0.0, 0.0, 0.0],
        [8.7173304301691801e-01, 0.0, 0.0, 0.0],
        [8.4457060015369423e-01, -1.1299064236484185e-01, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
)
GAMMAS = np.array(
    [
        [GAMMA, 0.0, 0.0, 0.0],
        [-8.7173304301691801e-01, GAMMA, 0.0, 0.0],
        [-9.0338057013044082e-01, 5.4180672388095326e-02, GAMMA, 0.0],
        [2.4212380706095346e-01, -1.2232505839045147e00, 5.4526025533510214e-01, GAMMA],
    ]
)
WEIGHTS = np.array([2.4212380706095346e-01, -1.2232505839045147e00, 1.5452602553351020e00, GAMMA])
NODES = ALPHA.sum(axis=1)
# In the variables U = Gamma k (Hairer and Wanner, Solving ODEs II, IV.7) no product with the Jacobian is needed.
_INVERSE = np.linalg.inv(GAMMAS)
STAGE = ALPHA @ _INVERSE
COUPLING = np.diag(np.full(4, 1.0 / GAMMA)) - _INVERSE
UPDATE = WEIGHTS @ _INVERSE

# Ports through which power enters the wing.
DAMPERS, FRONT_MOTOR, REAR_MOTOR, AIR, PORTS = 0, 1, 2, 3, 4
MAX_ROTATION = 1.0  # rad in one step; beyond, the individual has diverged


class Wiring(NamedTuple):
    """Topology and geometry, the same for every individual. Bodies 0..N-1, driving rods N and N+1.

    Connectors from number ``driven`` on start at a driving rod.
    """

    mass: Array
    inertia: Array
    first: Index
    second: Index
    block: Index
    driven: int
    a: Array
    b: Array
    start: Index
    below: Index
    row: Index
    products: Index
    product_start: Index
    strip_start: Index
    weight: Array
    centroid: Array
    area: Array
    markers: Array
    carrier: Index


class Setting(NamedTuple):
    """One condition: air density (kg/m^3), wind (m/s), gravity (m/s^2), step (s)."""

    density: float
    wind: Array
    gravity: float
    step: float


class Lanes(NamedTuple):
    """What differs between individuals.

    Stiffness and damping [C, 6, W], air coefficients [4, W], shares of lift and drag and where they act [N, W].
    """

    stiffness: Array
    damping: Array
    coefficients: Array
    lift_share: Array
    lift_x: Array
    drag_share: Array
    drag_x: Array


class State(NamedTuple):
    """Motion of all lanes: rotation [N+2, 9, W], position [N+2, 3, W], twist [N+2, 6, W]."""

    R: Array
    p: Array
    V: Array


class Work(NamedTuple):
    """Scratch of one group of lanes; see :func:`new_work` for the shapes."""

    R: Array
    p: Array
    V: Array
    xi: Array
    zero: Array
    r_xi: Array
    rods_only: Array
    U_xi: Array
    U_V: Array
    wrench: Array
    lead: Array
    Q: Array
    d: Array
    Q0: Array
    d0: Array
    C: Array
    hK: Array
    blocks: Array
    normal_damping: Array
    lost: Array
    stored: Array
    air_power: Array
    air_force: Array


class Trace(NamedTuple):
    """What a beat leaves behind, per step.

    tracks [n, M, 3, W]; wrench of the connectors on the driving rods [n, 2, 6, W]; force of the air in the world
    [n, 3, W]; power [n, PORTS, W] into the wing; energy [n, 3, W]: kinetic, elastic, gravitational. R, p, V: the motion
    of all bodies and rods [n, N+2, ., W] as in :class:`State`, or empty where nobody asked.
    """

    tracks: Array
    rods: Array
    air: Array
    power: Array
    energy: Array
    R: Array
    p: Array
    V: Array


@kernel
def set_rods(rods: Array, state: State) -> None:
    """Put the driving rods at angle and rate ``rods`` [2, 3] (angle, rate, acceleration) about the hinge."""
    n = len(state.R) - 2
    for k in range(2):
        c, s = math.cos(rods[k, 0]), math.sin(rods[k, 0])
        for i in range(9):
            store(state.R, n + k, i, 0.0)
        for i in range(6):
            store(state.V, n + k, i, 0.0)
        store(state.R, n + k, 0, 1.0)
        store(state.R, n + k, 4, c)
        store(state.R, n + k, 5, -s)
        store(state.R, n + k, 7, s)
        store(state.R, n + k, 8, c)
        store(state.V, n + k, 0, rods[k, 1])


@kernel
def _combine(base: Array, U: Array, coefficient: Array, count: int, factor_: float, out: Array) -> None:
    """out = base + factor * sum over the first ``count`` stages of coefficient * U."""
    for i in range(base.shape[0]):
        for k in range(base.shape[1]):
            total = load(base, i, k)
            for s in range(count):
                total += (factor_ * coefficient[s]) * load3(U, s, i, k)
            store(out, i, k, total)


def new_work(wiring: Wiring, lanes: Lanes, step: float) -> Work:
    """Scratch arrays for a group of lanes integrated with ``step``."""
    n, c = len(wiring.mass), len(wiring.first)
    motion, stages = (n + 2, 6, LANES), (4, n + 2, 6, LANES)
    hK = lanes.stiffness * (step * GAMMA)
    return Work(
        R=np.zeros((n + 2, 9, LANES)),
        p=np.zeros((n + 2, 3, LANES)),
        V=np.zeros(motion),
        xi=np.zeros(motion),
        zero=np.zeros(motion),
        r_xi=np.zeros(motion),
        rods_only=np.zeros(motion),
        U_xi=np.zeros(stages),
        U_V=np.zeros(stages),
        wrench=np.zeros(motion),
        lead=np.zeros(motion),
        Q=np.zeros((c, 9, LANES)),
        d=np.zeros((c, 3, LANES)),
        Q0=np.zeros((c, 9, LANES)),
        d0=np.zeros((c, 3, LANES)),
        C=lanes.damping + hK,
        hK=hK,
        blocks=np.zeros((n + len(wiring.below), 36, LANES)),
        normal_damping=np.zeros((n, LANES)),
        lost=np.zeros(LANES),
        stored=np.zeros(LANES),
        air_power=np.zeros(LANES),
        air_force=np.zeros((3, LANES)),
    )


@kernel
def forces(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work) -> None:
    """Wrenches on all bodies and rods at the pose and twist in ``work``."""
    n = len(wiring.mass)
    w_, Q, d = work.wrench, work.Q, work.d
    relative_pose(wiring.first, wiring.second, wiring.a, wiring.b, work.R, work.p, Q, d)
    inertial(wiring.mass, wiring.inertia, work.R, work.V, setting.gravity, w_)
    w_[n:] = 0.0
    work.lost[:] = 0.0
    work.stored[:] = 0.0
    work.air_power[:] = 0.0
    work.air_force[:] = 0.0
    connect(
        wiring.first, wiring.second, wiring.a, wiring.b, lanes.stiffness, lanes.damping,
        Q, d, work.V, w_, work.lost, work.stored,
    )  # fmt: skip
    strip_forces(
        wiring.strip_start, wiring.weight, wiring.centroid, wiring.area, setting.density, setting.wind,
        lanes.coefficients, lanes.lift_share, lanes.lift_x, lanes.drag_share, lanes.drag_x,
        work.R, work.V, w_, work.normal_damping, work.air_power, work.air_force,
    )  # fmt: skip


@kernel
def note(wiring: Wiring, setting: Setting, work: Work, trace: Trace, t: int) -> None:
    """Write down the motion, the rods' load, the air's force, powers and energies at the start of step ``t``.

    Powers are taken here and not at the stages, where stiff springs are far from their values at the step's ends.
    """
    n, power = len(wiring.mass), trace.power[t]
    store1(power, DAMPERS, -load0(work.lost))
    store1(power, AIR, load0(work.air_power))
    store1(power, FRONT_MOTOR, -load(work.wrench, n, 0) * load(work.V, n, 0))
    store1(power, REAR_MOTOR, -load(work.wrench, n + 1, 0) * load(work.V, n + 1, 0))
    trace.rods[t] = work.wrench[n:]
    trace.air[t] = work.air_force
    track(wiring.markers, wiring.carrier, work.R, work.p, trace.tracks[t])
    energy = trace.energy[t]
    kinetic_and_height(wiring.mass, wiring.inertia, work.p, work.V, setting.gravity, energy[0], energy[2])
    energy[1] = work.stored
    if len(trace.R):
        trace.R[t] = work.R
        trace.p[t] = work.p
        trace.V[t] = work.V


@kernel
def linearise(wiring: Wiring, setting: Setting, work: Work) -> None:
    """Assemble and factor the step's matrix at its start."""
    work.Q0[:] = work.Q
    work.d0[:] = work.d
    start_blocks(wiring.mass, wiring.inertia, 1.0 / (setting.step * GAMMA), work.normal_damping, work.blocks)
    add_connectors(wiring.first, wiring.second, wiring.block, wiring.a, wiring.b, work.C, work.Q0, work.d0, work.blocks)
    factor(wiring.start, wiring.below, wiring.products, wiring.product_start, work.blocks)


@kernel
def solve_stage(wiring: Wiring, setting: Setting, work: Work, rods: Array, stage: int) -> None:
    """Solve S U_V = M r_V - h gamma K r_xi - (D + h gamma K) U_rods for the stage; ``rods`` [2, 3] as in the drive.

    r = f + sum of COUPLING U / h; then U_xi = h gamma (U_V + r_xi). The rods' U is known, their acceleration being
    prescribed.
    """
    n, hg, k = len(wiring.mass), setting.step * GAMMA, wiring.driven
    U_V, r_xi, wrench = work.U_V[stage], work.r_xi, work.wrench
    local_rate(work.xi, work.V, r_xi)
    _combine(r_xi, work.U_xi, COUPLING[stage], stage, 1.0 / setting.step, r_xi)
    _combine(work.zero, work.U_V, COUPLING[stage], stage, 1.0 / setting.step, work.lead)
    for rod in range(2):
        value = hg * (load(work.lead, n + rod, 0) + rods[rod, 2])
        store(U_V, n + rod, 0, value)
        store(work.rods_only, n + rod, 0, value)
    times_mass(wiring.mass, wiring.inertia, work.lead, wrench)
    tangent(wiring.first, wiring.second, wiring.a, wiring.b, work.hK, work.Q0, work.d0, r_xi, wrench)
    tangent(
        wiring.first[k:], wiring.second[k:], wiring.a[k:], wiring.b[k:], work.C[k:],
        work.Q0[k:], work.d0[k:], work.rods_only, wrench,
    )  # fmt: skip
    solve(wiring.start, wiring.below, wiring.row, work.blocks, wrench)
    U_V[:n] = wrench[:n]
    for i in range(n + 2):
        for j in range(6):
            store3(work.U_xi, stage, i, j, hg * (load(U_V, i, j) + load(r_xi, i, j)))


@kernel
def finish_step(work: Work, state: State, alive: npt.NDArray[np.bool_]) -> None:
    """Take the step; a lane that turned too far or is no number any more is dead."""
    _combine(work.zero, work.U_xi, UPDATE, 4, 1.0, work.xi)
    _combine(state.V, work.U_V, UPDATE, 4, 1.0, work.V)
    move(state.R, state.p, work.xi, work.R, work.p)
    state.R[:] = work.R
    state.p[:] = work.p
    state.V[:] = work.V
    for i in range(len(work.xi)):
        for w in range(LANES):
            x, y, z = work.xi[i, 0, w], work.xi[i, 1, w], work.xi[i, 2, w]
            if not x * x + y * y + z * z < MAX_ROTATION**2:
                alive[w] = False


@kernel
def advance(
    wiring: Wiring,
    setting: Setting,
    lanes: Lanes,
    drive: Array,
    work: Work,
    state: State,
    trace: Trace,
    alive: npt.NDArray[np.bool_],
) -> None:
    """Integrate one beat of n steps from ``state``, in place.

    ``drive`` [n, 4, 2, 3]: angle, rate and acceleration of both rods at the four stages of every step. A lane whose
    bodies turn more than MAX_ROTATION in a step, or become NaN, is marked dead in ``alive`` and runs on, ignored.
    """
    for t in range(len(drive)):
        set_rods(drive[t, 0], state)
        work.xi[:] = 0.0
        work.R[:] = state.R
        work.p[:] = state.p
        work.V[:] = state.V
        for stage in range(4):
            if stage > 0:
                _combine(work.zero, work.U_xi, STAGE[stage], stage, 1.0, work.xi)
                _combine(state.V, work.U_V, STAGE[stage], stage, 1.0, work.V)
                move(state.R, state.p, work.xi, work.R, work.p)
            forces(wiring, setting, lanes, work)
            if stage == 0:
                note(wiring, setting, work, trace, t)
                linearise(wiring, setting, work)
            solve_stage(wiring, setting, work, drive[t, stage], stage)
        finish_step(work, state, alive)
