"""The step's matrix against the connectors' own tangent, and its factors against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from records import Genome
from sim.division import Division
from sim.kernels import LANES
from sim.kernels.bodies import times_mass
from sim.kernels.connectors import relative_pose, tangent
from sim.kernels.linear import add_connectors, factor, solve, start_blocks
from sim.rig import robird_wing
from sim.simulate import at_rest
from sim.structure import build
from sim.wing_genes import lanes, wing_genes


@pytest.mark.parametrize("division", ["4", "11", "24", "2x5"])
def test_solving_undoes_the_product_with_the_matrix(division: str) -> None:
    structure = build(robird_wing(), Division.parse(division))
    w, genes = structure.wiring, wing_genes({})
    group = lanes(structure, genes, np.array([Genome.nominal(genes).values]))
    rng, state, n = np.random.default_rng(1), at_rest(structure), len(structure.bodies)
    # a bent wing: every body turned and shifted a little, differently in each lane
    state.p[:n] += 1e-3 * rng.normal(size=(n, 3, LANES))
    skew = 0.2 * rng.normal(size=(n, 3, LANES))
    state.R[:n, 5] -= skew[:, 0]
    state.R[:n, 7] += skew[:, 0]
    Q, d = np.zeros((len(w.first), 9, LANES)), np.zeros((len(w.first), 3, LANES))
    relative_pose(w.first, w.second, w.a, w.b, state.R, state.p, Q, d)
    damping = np.abs(rng.normal(size=(n, LANES)))
    blocks = np.zeros((n + len(w.below), 36, LANES))
    start_blocks(w.mass, w.inertia, 700.0, damping, blocks)
    add_connectors(w.first, w.second, w.block, w.a, w.b, group.damping, Q, d, blocks)
    factor(w.start, w.below, w.products, w.product_start, blocks)
    x = np.zeros((n + 2, 6, LANES))
    x[:n] = rng.normal(size=(n, 6, LANES))
    product = np.zeros_like(x)
    tangent(w.first, w.second, w.a, w.b, group.damping, Q, d, -x, product)
    times_mass(w.mass, w.inertia, x * 700.0, product)
    product[:n, 5] += damping * x[:n, 5]
    solve(w.start, w.below, w.row, blocks, product)
    np.testing.assert_allclose(product[:n], x[:n], rtol=1e-7, atol=1e-8)
