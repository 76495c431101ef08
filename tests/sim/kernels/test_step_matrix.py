"""The step's matrix against finite differences of everything but the air, and its factors against numpy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.records import Genome
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, Setting, State, Wiring, Work, new_work
from wingfit.sim.kernels.bodies import move
from wingfit.sim.kernels.integrate import GAMMA, forces, linearise
from wingfit.sim.kernels.lanes.vector import load, load1, store, store1
from wingfit.sim.kernels.laws import connector_port, point_port
from wingfit.sim.kernels.linear import solve
from wingfit.sim.kernels.masses import add_mass_blocks
from wingfit.sim.kernels.points import add_point_blocks
from wingfit.sim.kernels.stages import coupled_rates, keep_stage
from wingfit.sim.kernels.states import keep_tangents
from wingfit.sim.kernels.tangents import add_connectors, start_blocks
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import robird_wing, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.genes import lanes, wing_genes
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]
Change = Callable[[WingScene, np.random.Generator], None]
STEP = 2e-3
LENGTH = STEP * GAMMA
WIND = np.array([5.0, -1.0, 2.0])


class Case(NamedTuple):
    """A bent wing in full motion, different in each lane, with what some effects have changed."""

    wiring: Wiring
    here: Setting
    lanes: Lanes
    work: Work
    state: State


def bent(
    division: str, *changes: Change, coupled: bool = False, wind: tuple[float, ...] | Array = (0.0, 0.0, 0.0)
) -> Case:
    structure: Structure = build(robird_wing(), Division.parse(division), whole_strips=len(changes) > 0)
    w, genes, rng = structure.wiring, wing_genes({}), np.random.default_rng(1)
    own = lanes(structure, genes, np.array([Genome.nominal(genes).values]))
    if coupled:
        K = 50.0 * rng.normal(size=(len(w.first), 3, 3, LANES))
        own = own._replace(coupling=np.ascontiguousarray((K + K.swapaxes(1, 2)).reshape(len(w.first), 9, LANES)))
    scene = WingScene.of(structure, vacuum(0.0, 0.0, 3.0), own)
    for change in changes:
        change(scene, rng)
    group = scene.frozen()
    here = Setting(np.zeros(LANES), np.repeat(np.array(wind)[:, None], LANES, axis=1), 9.81, STEP)
    rest, n = at_rest(structure), len(w.mass) + 2
    scale = np.array([0.2, 0.2, 0.2, 0.01, 0.01, 0.01])[:, None]
    z = rng.normal(size=(len(group.laws.size), LANES))
    twist = 15.0 * rng.normal(size=(n, 6, LANES)) * scale
    state = State(np.zeros_like(rest.R), np.zeros_like(rest.p), twist, z)
    move(rest.R, rest.p, rng.normal(size=(n, 6, LANES)) * scale, state.R, state.p)
    return Case(w, here, group, new_work(w, here, group), state)


def weights(scene: WingScene, rng: np.random.Generator) -> None:
    """Weight on every body as large as its own, off its centre, different in each lane."""
    for n, body in enumerate(scene.structure.bodies):
        mass = body.mass * rng.uniform(0.5, 2.0, LANES)
        part = rng.normal(size=(3, 3, LANES)) * np.sqrt(body.inertia[2, 2])
        inertia = np.einsum("ikw,jkw->ijw", part, part)
        scene.add_mass(n, mass, mass * 0.02 * rng.normal(size=(3, LANES)), inertia)


def moved_air(scene: WingScene, rng: np.random.Generator) -> None:
    """Air as heavy as the bodies, in one symmetric positive matrix for all bodies of a strip."""
    division = scene.structure.division
    for strip, count in enumerate(division.bodies):
        bodies = [scene.structure.bodies[division.index(strip, k)] for k in range(count)]
        rows = [[np.sqrt(b.inertia[2, 2])] * 2 + [0.0] * 3 + [np.sqrt(b.mass)] for b in bodies]  # moved along z alone
        size = np.concatenate(rows)
        part = rng.normal(size=(6 * count, 6 * count, LANES)) * size[:, None, None] / np.sqrt(6 * count)
        whole = np.einsum("ikw,jkw->ijw", part, part)
        for i in range(count):
            for j in range(count):
                block = whole[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
                scene.add_air(division.index(strip, i), division.index(strip, j), block)


def _joint(frame: Any, moment: int) -> None:  # noqa: ARG001 (an argument of all laws)
    """Springs against displacement, dampers, and a state along every axis that relaxes and pulls, both not linearly."""
    port = connector_port(frame)
    for k in range(6):
        state, rate, decay = port.state[k], port.rate[k], port.decay[k]
        for c in range(port.places):
            spring, damper = load(port.parameters, 0, c), load(port.parameters, 1, c)
            x, v, z = load(port.d, c, k % 3), load(port.twist, c, k), load1(state, c)
            wrench = load(port.wrench, c, k) - damper * v - spring * (z + 0.2 * z * z * z)
            if k > 2:
                wrench = wrench - spring * x
                store(port.stiffness, c, k, load(port.stiffness, c, k) + spring)
            store(port.wrench, c, k, wrench)
            store(port.damping, c, k, load(port.damping, c, k) + damper)
            store1(rate, c, 0.7 * v - 90.0 * z - 30.0 * z * z * z)
            store1(decay, c, 90.0 + 90.0 * z * z)
            store1(port.drive[k], c, 0.7 + 0.0 * z)
            store1(port.pull[k], c, spring * (1.0 + 0.6 * z * z))


def joints(scene: WingScene, rng: np.random.Generator) -> None:
    """A law on every connector, with parameters of its own in each."""
    count = len(scene.structure.connectors)
    given = [rng.uniform(0.5, 2.0, (count, LANES)) * size for size in (3.0, 0.02)]
    scene.add_connector_law(_joint, given, axes=[0, 1, 2, 3, 4, 5], states=[1.0] * 6)


def _guy(frame: Any, moment: int) -> None:  # noqa: ARG001
    """A force and a moment at a point that depend on its place, rotation and twist: all blocks of both matrices.

    f = -s |x|^2 x - d v - q omega,  m = g e_x x n - r x - q omega - d v,  n being the body's normal.
    """
    port = point_port(frame)
    for p in range(port.places):
        s, d, q = load(port.parameters, 0, p), load(port.parameters, 1, p), load(port.parameters, 2, p)
        g, r = load(port.parameters, 3, p), load(port.parameters, 4, p)
        x, y, z = load(port.place, p, 0), load(port.place, p, 1), load(port.place, p, 2)
        normal = (load(port.turn, p, 2), load(port.turn, p, 5), load(port.turn, p, 8))
        upright = (0.0 * g, -g * normal[2], g * normal[1])
        square = x * x + y * y + z * z
        for i in range(3):
            here, omega, v = load(port.place, p, i), load(port.twist, p, i), load(port.twist, p, 3 + i)
            store(port.wrench, p, i, load(port.wrench, p, i) + upright[i] - r * here - q * omega - d * v)
            store(port.wrench, p, 3 + i, load(port.wrench, p, 3 + i) - s * square * here - d * v - q * omega)
            for at, gain in ((7 * i, q), (7 * i + 3, d), (7 * i + 18, q), (7 * i + 21, d)):
                store(port.damping, p, at, load(port.damping, p, at) + gain)
            for at, gain in ((7 * i, -g * normal[0]), (6 * i, g * normal[i]), (7 * i + 3, r), (7 * i + 21, s * square)):
                store(port.stiffness, p, at, load(port.stiffness, p, at) + gain)
            for j in range(3):
                at = 21 + 6 * i + j
                store(port.stiffness, p, at, load(port.stiffness, p, at) + 2.0 * s * here * load(port.place, p, j))


def points(scene: WingScene, rng: np.random.Generator) -> None:
    """Two laws at points, each elsewhere in each lane: some share a body."""
    for _ in range(2):
        given = [rng.uniform(0.5, 2.0, LANES) * size for size in (2e3, 2.0, 0.02, 5.0, 3.0)]
        scene.add_point_law(_guy, rng.uniform(0.0, 1.0, LANES), rng.uniform(0.0, 1.0, LANES), given)


def rates(case: Case, xi: Array, V: Array, z: Array) -> tuple[Array, Array, Array]:
    """Rates of coordinates, wrenches [N + 2, 6, W], rates of states, at a displacement, more twist and more state."""
    work, rate = case.work, np.zeros_like(xi)
    move(case.state.R, case.state.p, xi, work.R, work.p)
    work.V[:] = case.state.V + V
    work.z[:] = case.state.z + z
    nothing = np.zeros((1, *xi.shape))
    coupled_rates(xi, work.V, nothing, nothing, np.zeros(1), 0, 1.0, rate, np.zeros_like(xi))
    forces(case.wiring, case.here, case.lanes, work)
    return rate, work.wrench.copy(), work.z_rate.copy()


def undisturbed(case: Case) -> tuple[Array, Array, Array]:
    return np.zeros_like(case.state.V), np.zeros_like(case.state.V), np.zeros_like(case.state.z)


def derivatives(case: Case, lane: int, kind: int, eps: float = 1e-6) -> list[Array]:
    """Of the three :func:`rates` by the coordinates (kind 0), the twists (1) or the states (2), central differences."""
    count = undisturbed(case)[kind][..., 0].size
    found = [np.zeros((part[..., 0].size, count)) for part in rates(case, *undisturbed(case))]
    for k in range(count):
        d = undisturbed(case)
        d[kind].reshape(-1, LANES)[k] = eps
        up, down = rates(case, *d), rates(case, *(-x for x in d))
        for columns, a, b in zip(found, up, down, strict=True):
            columns[:, k] = ((a - b)[..., lane] / (2 * eps)).ravel()
    return found


def inertia_matrix(case: Case, lane: int) -> Array:
    """[6 N + 12, 6 N + 12], of bodies and of what moves with them."""
    w, size = case.wiring, case.state.V[..., 0].size
    M = np.zeros((size // 6, 6, size // 6, 6))
    for n, mass in enumerate(w.mass):
        M[n, :3, n, :3], M[n, 3:, n, 3:] = w.inertia[n].reshape(3, 3), mass * np.eye(3)
    for (i, j, _), block in zip(case.lanes.pairs, case.lanes.masses[..., lane], strict=True):
        M[i, :, j] += block.reshape(6, 6)
    return M.reshape(size, size)


def by_differences(case: Case, lane: int) -> Array:
    """S = (M / l - dW/dV) (I - l A) - l dW/dxi of one lane, the states eliminated: U_z = theta (g_V U_V + g_xi U_xi).

    theta = (1 / l - g_z)^-1, g being the states' rates.
    """
    (A, W_xi, g_xi), (_, W_V, g_V), (_, W_z, g_z) = (derivatives(case, lane, kind) for kind in range(3))
    pulled = W_z @ np.linalg.inv(np.eye(len(g_z)) / LENGTH - g_z)
    moving = inertia_matrix(case, lane) / LENGTH - W_V - pulled @ g_V
    return np.asarray(moving @ (np.eye(len(A)) - LENGTH * A) - LENGTH * (W_xi + pulled @ g_xi))


def assembled(case: Case, lane: int) -> Array:
    """The matrix of the kernels, not factored, with the columns of the driving rods."""
    w, here, group, work, _ = case
    n = len(w.mass)
    rates(case, *undisturbed(case))
    work.more_d0[:] = work.more_d
    keep_tangents(group.laws, w, LENGTH, work)
    start_blocks(w.mass, w.inertia, np.zeros((n, LANES)), work.R, work.V, here.gravity, LENGTH, w.fill, work.blocks)
    add_connectors(
        w.first, w.second, w.lower, w.upper, w.a, w.b, group.stiffness, group.damping, group.coupling,
        work.more, work.more_k, work.more_d0, work.Q, work.d, work.V, LENGTH, work.blocks,
    )  # fmt: skip
    add_mass_blocks(group, here, work.R, work.V, LENGTH, work.blocks)
    add_point_blocks(group.laws, work, LENGTH)
    found, blocks = np.zeros((n + 2, 6, n + 2, 6)), work.blocks[..., lane].reshape(-1, 6, 6)
    for k in range(n):
        found[k, :, k] = blocks[k]
        column = w.order[k]
        for s in range(w.start[k], w.start[k + 1]):
            found[w.row[s], :, column] = blocks[w.below[s]]
            found[column, :, w.row[s]] = blocks[w.below[s] + len(w.below)]
    for c in range(w.driven, len(w.first)):
        found[w.second[c], :, w.first[c]] = blocks[w.lower[c]]
    return found.reshape(6 * n + 12, 6 * n + 12)


def relative_errors(found: Array, expected: Array) -> Array:
    """Per block of moments and forces, so that a small wrong one does not hide behind a large right one."""
    shape = (len(found) // 3, 3, found.shape[1] // 3, 3)
    size = np.abs(expected.reshape(shape)).max(axis=(1, 3), keepdims=True)
    error = np.abs((found - expected).reshape(shape)) / np.maximum(size, 1e-6 * size.max())
    return np.asarray(error.reshape(found.shape))


def assert_same(found: Array, expected: Array) -> None:
    assert relative_errors(found, expected).max() < 1e-4
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


def assemble_and_differentiate(*changes: Change) -> None:
    """Check the matrix of a bent wing with effects in one lane."""
    case, lane = bent("3,2", *changes, coupled=True), 5
    assert_same(assembled(case, lane)[:-12], by_differences(case, lane)[:-12])


@pytest.mark.parametrize(("division", "coupled"), [("3,2", False), ("3,2", True), ("1,1,1", False)])
def test_matrix_is_the_exact_derivative(division: str, coupled: bool) -> None:
    case, lane = bent(division, coupled=coupled), 3
    assert_same(assembled(case, lane)[:-12], by_differences(case, lane)[:-12])


@pytest.mark.parametrize(
    "changes",
    [(weights,), (moved_air,), (joints,), (points,), (weights, moved_air, joints, points)],
    ids=["weight", "air", "connectors", "points", "all"],
)
def test_matrix_is_the_exact_derivative_with_effects(changes: tuple[Change, ...]) -> None:
    """Weights, air that the bodies of a strip move together, laws of connectors with states, and laws of points."""
    assemble_and_differentiate(*changes)


def test_air_in_wind_is_in_the_matrix() -> None:
    """The wind turns in the frames of the bodies."""
    case, lane = bent("3,2", moved_air, wind=WIND), 5
    expected = by_differences(case, lane)[:-12]
    assert relative_errors(assembled(case, lane)[:-12], expected).max() < 1e-4


@pytest.mark.parametrize(
    ("division", "changes"),
    [
        ("4", ()),
        ("11", ()),
        ("24", ()),
        ("2x5", ()),
        ("11", (weights, moved_air, joints, points)),
        ("2x5", (moved_air,)),
    ],
)
def test_solving_undoes_the_product_with_the_matrix(division: str, changes: tuple[Change, ...]) -> None:
    case, rng = bent(division, *changes), np.random.default_rng(2)
    case.work.blocks[:] = np.nan  # nothing may be left over from the step before
    n = len(case.wiring.mass)
    x = rng.normal(size=(n + 2, 6, LANES))
    x[n:] = 0.0
    matrices = [assembled(case, lane) for lane in range(LANES)]
    product = np.stack([(S @ x[..., k].ravel()).reshape(n + 2, 6) for k, S in enumerate(matrices)], axis=-1)
    case.work.normal_damping[:] = 0.0
    linearise(case.wiring, case.here, case.lanes, case.work)
    w = case.wiring
    solve(w.order, w.start, w.below, w.row, case.work.blocks, product)
    np.testing.assert_allclose(product[:n], x[:n], rtol=1e-7, atol=1e-8)


def test_damping_of_the_air_is_in_the_matrix() -> None:
    """Normal damping d adds d e e^T (I - l A) to each body's block, e being the normal."""
    case = bent("1,1")
    w, work, n = case.wiring, case.work, 2
    damping = np.abs(np.random.default_rng(3).normal(size=(n, LANES)))
    rates(case, *undisturbed(case))
    found = []
    for d in (damping, 0 * damping):
        start_blocks(w.mass, w.inertia, d, work.R, work.V, case.here.gravity, LENGTH, w.fill, work.blocks)
        found.append(work.blocks[:n].copy().reshape(n, 6, 6, LANES))
    unit = np.zeros((n, 6, LANES))
    for column in range(6):
        unit[:] = 0.0
        unit[:, column] = 1.0
        out, nothing = np.zeros_like(unit), np.zeros_like(unit)
        keep_stage(unit, nothing, np.ascontiguousarray(case.state.V[:n]), LENGTH, nothing.copy(), out)
        np.testing.assert_allclose((found[0] - found[1])[:, 5, column], damping * out[:, 5], atol=1e-9)
    np.testing.assert_array_equal((found[0] - found[1])[:, :5], 0.0)
