"""Rosenbrock integration of the wing over its beats, eight individuals at a time.

The method is RODAS4P2 (Steinebach, *Improvement of Rosenbrock-Wanner Method RODASP*, 2020): six stages, fourth order,
L-stable, stiffly accurate, made to keep its order on stiff problems and to lose little when the Jacobian is not quite
exact. Ours is exact but for the air, of which it has the damping along the normal. Driving rods are bodies with a
prescribed acceleration, so that stiff roots see consistent stages; their pose is set to the exact profile at each
step's start.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim.kernels import LANES
from sim.kernels.air import strip_forces
from sim.kernels.bodies import inertial, kinetic_and_height, move, track
from sim.kernels.connectors import connect, relative_pose, tangent
from sim.kernels.jit import kernel
from sim.kernels.linear import factor, solve, subtract_column
from sim.kernels.memory import aligned, zeros
from sim.kernels.stages import combine, coupled_rates, keep_stage
from sim.kernels.tangents import add_connectors, add_own_terms, start_blocks
from sim.kernels.vector import load, load0, load3, store, store1

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

STAGES = 6
GAMMA = 0.25
NODES = np.array([0.0, 0.75, 0.321448134013046, 0.519745732277726, 1.0, 1.0])
# Sum of the gammas of each stage: how much of the drive's change of acceleration it sees.
SLOPES = np.array([0.25, -0.5, -0.189532918363016, 0.085612108792769, 0.0, 0.0])
# In the variables U = Gamma k (Hairer and Wanner, Solving ODEs II, IV.7) no product with the Jacobian is needed: one is
# at y + sum of STAGE U, its right-hand side has sum of COUPLING U / h. The last two stages and the result each
# add the U before to the state before.
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

NO_COUPLING = np.zeros((0, 9, LANES))

# Ports through which power enters the wing.
DAMPERS, FRONT_MOTOR, REAR_MOTOR, AIR, PORTS = 0, 1, 2, 3, 4
MAX_ROTATION = 1.0  # rad in one step; beyond, the individual has diverged


class Wiring(NamedTuple):
    """Topology and geometry, the same for every individual. Bodies 0..N-1, driving rods N and N+1.

    Connectors from number ``driven`` on start at a driving rod. ``lower`` and ``upper`` are their blocks in the matrix
    (``sim.kernels.tangents``); order to fill are that of ``sim.elimination``.
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

    Stiffness and damping [C, 6, W], air coefficients [4, W], shares of lift and drag and where they act [N, W], and
    the stiffness [C, 9, W] that couples rotation with translation, or none.
    """

    stiffness: Array
    damping: Array
    coefficients: Array
    lift_share: Array
    lift_x: Array
    drag_share: Array
    drag_x: Array
    coupling: Array = NO_COUPLING


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
    r_xi: Array
    known: Array
    U_xi: Array
    U_V: Array
    wrench: Array
    lead: Array
    Q: Array
    d: Array
    Q0: Array
    d0: Array
    against: Array
    blocks: Array
    normal_damping: Array
    drag0: Array
    V0: Array
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


def new_work(wiring: Wiring, lanes: Lanes) -> Work:
    """Scratch arrays for a group of lanes."""
    n, c = len(wiring.mass), len(wiring.first)
    motion, stages = (n + 2, 6, LANES), (STAGES, n + 2, 6, LANES)
    blocks = n + 2 * len(wiring.below) + c - wiring.driven
    return Work(
        R=zeros((n + 2, 9, LANES)),
        p=zeros((n + 2, 3, LANES)),
        V=zeros(motion),
        xi=zeros(motion),
        r_xi=zeros(motion),
        known=zeros(motion),
        U_xi=zeros(stages),
        U_V=zeros(stages),
        wrench=zeros(motion),
        lead=zeros(motion),
        Q=zeros((c, 9, LANES)),
        d=zeros((c, 3, LANES)),
        Q0=zeros((c, 9, LANES)),
        d0=zeros((c, 3, LANES)),
        against=aligned(-lanes.damping),
        blocks=zeros((blocks, 36, LANES)),
        normal_damping=zeros((n, LANES)),
        drag0=zeros((n, LANES)),
        V0=zeros(motion),
        lost=zeros((LANES,)),
        stored=zeros((LANES,)),
        air_power=zeros((LANES,)),
        air_force=zeros((3, LANES)),
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
        lanes.coupling, Q, d, work.V, w_, work.lost, work.stored,
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
def linearise(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work) -> None:
    """Assemble and factor the step's matrix S at its start (``sim.kernels.tangents``)."""
    hg = setting.step * GAMMA
    work.Q0[:] = work.Q
    work.d0[:] = work.d
    work.drag0[:] = work.normal_damping
    work.V0[:] = work.V
    start_blocks(wiring.mass, wiring.inertia, work.drag0, work.R, work.V, setting.gravity, hg, wiring.fill, work.blocks)
    add_connectors(
        wiring.first, wiring.second, wiring.lower, wiring.upper, wiring.a, wiring.b,
        lanes.stiffness, lanes.damping, lanes.coupling, work.Q0, work.d0, work.V, hg, work.blocks,
    )  # fmt: skip
    factor(wiring.order, wiring.start, wiring.below, wiring.products, wiring.product_start, work.blocks)


@kernel
def solve_stage(wiring: Wiring, setting: Setting, work: Work, rods: Array, stage: int) -> None:
    """Solve the stage for U_V and U_xi; ``rods`` [2, 3] as in the drive.

    With r = f + sum of COUPLING U / h, the unknown Y = U_xi / (h gamma) meets S Y = M (r_V + r_xi / (h gamma)) -
    dW/dV r_xi, and U_V = (I - h gamma A) Y - r_xi. The rods' Y is known, their acceleration being prescribed.
    """
    n, hg, k = len(wiring.mass), setting.step * GAMMA, wiring.driven
    r_xi, wrench, known = work.r_xi, work.wrench, work.known
    coupled_rates(work.xi, work.V, work.U_xi, work.U_V, COUPLING[stage], stage, 1.0 / setting.step, r_xi, work.lead)
    for rod in range(n, n + 2):
        turn = hg * (load(work.lead, rod, 0) + rods[rod - n, 2])
        store(known, rod, 0, turn + load(r_xi, rod, 0))
        for j in range(1, 6):
            store(known, rod, j, load(r_xi, rod, j))
    add_own_terms(wiring.mass, wiring.inertia, work.drag0, work.V0, 1.0 / hg, work.lead, r_xi, wrench)
    tangent(wiring.first, wiring.second, wiring.a, wiring.b, work.against, work.Q0, work.d0, r_xi, wrench)
    for c in range(k, len(wiring.first)):
        subtract_column(wiring.second[c], wiring.lower[c], work.blocks, known, wiring.first[c], wrench)
    solve(wiring.order, wiring.start, wiring.below, wiring.row, work.blocks, wrench)
    known[:n] = wrench[:n]
    keep_stage(known, r_xi, work.V0, hg, work.U_xi[stage], work.U_V[stage])


@kernel
def _to_stage(work: Work, state: State, stage: int) -> None:
    """Local coordinates, twist and pose of a stage."""
    if stage < STAGES - 1:
        combine(0.0, state.V, work.U_xi, STAGE[stage], stage, work.xi)
        combine(1.0, state.V, work.U_V, STAGE[stage], stage, work.V)
    else:
        for i in range(work.xi.shape[0]):
            for k in range(6):
                store(work.xi, i, k, load(work.xi, i, k) + load3(work.U_xi, stage - 1, i, k))
                store(work.V, i, k, load(work.V, i, k) + load3(work.U_V, stage - 1, i, k))
    move(state.R, state.p, work.xi, work.R, work.p)


@kernel
def finish_step(work: Work, state: State, alive: npt.NDArray[np.bool_]) -> None:
    """Take the step; a lane that turned too far or is no number any more is dead."""
    _to_stage(work, state, STAGES)
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

    ``drive`` [n, STAGES, 2, 3]: angle, rate and acceleration of both rods at the stages of every step; angle and rate
    are taken at its start only, in between they follow from the acceleration. A lane whose bodies turn more than
    MAX_ROTATION in a step, or become NaN, is marked dead in ``alive`` and runs on, ignored.
    """
    for t in range(len(drive)):
        set_rods(drive[t, 0], state)
        work.xi[:] = 0.0
        work.R[:] = state.R
        work.p[:] = state.p
        work.V[:] = state.V
        for stage in range(STAGES):
            if stage > 0:
                _to_stage(work, state, stage)
            forces(wiring, setting, lanes, work)
            if stage == 0:
                note(wiring, setting, work, trace, t)
                linearise(wiring, setting, lanes, work)
            solve_stage(wiring, setting, work, drive[t, stage], stage)
        finish_step(work, state, alive)
