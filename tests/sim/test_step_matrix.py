"""The step's matrix against finite differences of everything but the air, and its factors against numpy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from records import Genome
from sim.division import Division
from sim.kernels import LANES
from sim.kernels.bodies import move
from sim.kernels.integrate import GAMMA, Lanes, Setting, State, Wiring, Work, forces, linearise, new_work
from sim.kernels.linear import solve
from sim.kernels.stages import coupled_rates, keep_stage
from sim.kernels.tangents import add_connectors, start_blocks
from sim.rig import robird_wing
from sim.scene import at_rest
from sim.structure import Structure, build
from sim.wing_genes import lanes, wing_genes

Array = npt.NDArray[np.float64]
HERE = Setting(0.0, np.zeros(3), 9.81, 2e-3)
LENGTH = HERE.step * GAMMA


class Case(NamedTuple):
    """A bent wing in full motion, different in each lane."""

    wiring: Wiring
    lanes: Lanes
    work: Work
    state: State


def bent(division: str, *, coupled: bool = False) -> Case:
    structure: Structure = build(robird_wing(), Division.parse(division))
    w, genes, rng = structure.wiring, wing_genes({}), np.random.default_rng(1)
    group = lanes(structure, genes, np.array([Genome.nominal(genes).values]))
    if coupled:
        K = 50.0 * rng.normal(size=(len(w.first), 3, 3, LANES))
        group = group._replace(coupling=np.ascontiguousarray((K + K.swapaxes(1, 2)).reshape(len(w.first), 9, LANES)))
    rest, n = at_rest(structure), len(w.mass) + 2
    scale = np.array([0.2, 0.2, 0.2, 0.01, 0.01, 0.01])[:, None]
    state = State(np.zeros_like(rest.R), np.zeros_like(rest.p), 15.0 * rng.normal(size=(n, 6, LANES)) * scale)
    move(rest.R, rest.p, rng.normal(size=(n, 6, LANES)) * scale, state.R, state.p)
    return Case(w, group, new_work(w, group), state)


def rates(case: Case, xi: Array, V: Array) -> tuple[Array, Array]:
    """Rate of the local coordinates and wrenches [N + 2, 6, W] at a displacement and a change of twist."""
    work, rate = case.work, np.zeros_like(xi)
    move(case.state.R, case.state.p, xi, work.R, work.p)
    work.V[:] = case.state.V + V
    nothing = np.zeros((1, *xi.shape))
    coupled_rates(xi, work.V, nothing, nothing, np.zeros(1), 0, 1.0, rate, np.zeros_like(xi))
    forces(case.wiring, HERE, case.lanes, work)
    return rate, work.wrench.copy()


def by_differences(case: Case, lane: int) -> Array:
    """S = (M / l - dW/dV) (I - l A) - l dW/dxi of one lane, from central differences."""
    size, eps = case.state.V[..., 0].size, 1e-6
    A, by_pose, by_twist = (np.zeros((size, size)) for _ in range(3))
    nothing = np.zeros_like(case.state.V)
    for k in range(size):
        d = np.zeros_like(nothing)
        d.reshape(size, LANES)[k] = eps
        up, down = rates(case, d, nothing), rates(case, -d, nothing)
        A[:, k] = ((up[0] - down[0])[..., lane] / (2 * eps)).ravel()
        by_pose[:, k] = ((up[1] - down[1])[..., lane] / (2 * eps)).ravel()
        up, down = rates(case, nothing, d), rates(case, nothing, -d)
        by_twist[:, k] = ((up[1] - down[1])[..., lane] / (2 * eps)).ravel()
    M = np.zeros((size, size))
    for n, mass in enumerate(case.wiring.mass):
        M[6 * n : 6 * n + 3, 6 * n : 6 * n + 3] = case.wiring.inertia[n].reshape(3, 3)
        M[6 * n + 3 : 6 * n + 6, 6 * n + 3 : 6 * n + 6] = mass * np.eye(3)
    return np.asarray((M / LENGTH - by_twist) @ (np.eye(size) - LENGTH * A) - LENGTH * by_pose)


def assembled(case: Case, lane: int) -> Array:
    """The matrix of the kernels, not factored, with the columns of the driving rods."""
    w, work, n = case.wiring, case.work, len(case.wiring.mass)
    rates(case, np.zeros_like(case.state.V), np.zeros_like(case.state.V))
    start_blocks(w.mass, w.inertia, np.zeros((n, LANES)), work.R, work.V, HERE.gravity, LENGTH, w.fill, work.blocks)
    add_connectors(
        w.first, w.second, w.lower, w.upper, w.a, w.b, case.lanes.stiffness, case.lanes.damping, case.lanes.coupling,
        work.Q, work.d, work.V, LENGTH, work.blocks,
    )  # fmt: skip
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


@pytest.mark.parametrize(("division", "coupled"), [("3,2", False), ("3,2", True), ("1,1,1", False)])
def test_matrix_is_the_exact_derivative(division: str, coupled: bool) -> None:
    case, lane = bent(division, coupled=coupled), 3
    expected, found = by_differences(case, lane)[:-12], assembled(case, lane)[:-12]
    # per block of moments and forces, so that a small wrong one does not hide behind a large right one
    shape = (len(found) // 3, 3, found.shape[1] // 3, 3)
    size = np.abs(expected.reshape(shape)).max(axis=(1, 3), keepdims=True)
    error = np.abs((found - expected).reshape(shape)) / np.maximum(size, 1e-6 * size.max())
    assert error.max() < 1e-4
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("division", ["4", "11", "24", "2x5"])
def test_solving_undoes_the_product_with_the_matrix(division: str) -> None:
    case, rng = bent(division), np.random.default_rng(2)
    case.work.blocks[:] = np.nan  # nothing may be left over from the step before
    n = len(case.wiring.mass)
    x = rng.normal(size=(n + 2, 6, LANES))
    x[n:] = 0.0
    matrices = [assembled(case, lane) for lane in range(LANES)]
    product = np.stack([(S @ x[..., k].ravel()).reshape(n + 2, 6) for k, S in enumerate(matrices)], axis=-1)
    case.work.normal_damping[:] = 0.0
    linearise(case.wiring, HERE, case.lanes, case.work)
    w = case.wiring
    solve(w.order, w.start, w.below, w.row, case.work.blocks, product)
    np.testing.assert_allclose(product[:n], x[:n], rtol=1e-7, atol=1e-8)


def test_damping_of_the_air_is_in_the_matrix() -> None:
    """Normal damping d adds d e e^T (I - l A) to each body's block, e being the normal."""
    case = bent("1,1")
    w, work, n = case.wiring, case.work, 2
    damping = np.abs(np.random.default_rng(3).normal(size=(n, LANES)))
    rates(case, np.zeros_like(case.state.V), np.zeros_like(case.state.V))
    found = []
    for d in (damping, 0 * damping):
        start_blocks(w.mass, w.inertia, d, work.R, work.V, HERE.gravity, LENGTH, w.fill, work.blocks)
        found.append(work.blocks[:n].copy().reshape(n, 6, 6, LANES))
    unit = np.zeros((n, 6, LANES))
    for column in range(6):
        unit[:] = 0.0
        unit[:, column] = 1.0
        out, nothing = np.zeros_like(unit), np.zeros_like(unit)
        keep_stage(unit, nothing, np.ascontiguousarray(case.state.V[:n]), LENGTH, nothing.copy(), out)
        np.testing.assert_allclose((found[0] - found[1])[:, 5, column], damping * out[:, 5], atol=1e-9)
    np.testing.assert_array_equal((found[0] - found[1])[:, :5], 0.0)
