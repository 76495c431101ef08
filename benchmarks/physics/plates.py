"""Uniform foam plates with known rods as test cases, and their linear statics computed with the simulator's springs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from wingfit.records import FourierDrive, Hinge, Marker, Materials, Rod, Station, Wing
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes
from wingfit.sim.kernels.connectors import connect, relative_pose, tangent
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.wing.genes import lanes, wing_genes
from wingfit.sim.wing.structure import Structure

Array = npt.NDArray[np.float64]


def plate(chord: float, span: float, thickness: float, rods: tuple[Rod, Rod], markers: tuple[Marker, ...] = ()) -> Wing:
    """Return a rectangular wing (lengths in m) with a corner at the origin, of foam with 20 kg/m^3 and without skin.

    Both ``rods`` are driving rods, and the drive is at rest. ``markers``: tracked points besides one at the tip.
    """
    stations = tuple(Station(y, 0.0, chord, thickness) for y in (0.0, span))
    tip = Marker("tip", (chord / 2, span - 1e-9, 0.0), 0.0)
    marks = (*markers, tip)
    return Wing(
        "plate", stations, Materials(20.0, 0.0), rods, (rods[0].name, rods[1].name), marks, (tip.name,),
        Hinge(0.0, 0.0), FourierDrive(0.0, (), ()),
    )  # fmt: skip


def loaded(structure: Structure, genome: Mapping[str, float]) -> Lanes:
    """Return the simulator's parameter arrays for individuals with equal gene values.

    ``genome``: gene values by name; others are nominal.
    """
    genes = wing_genes({})
    return lanes(structure, genes, np.array([[genome.get(g.name, g.nominal) for g in genes]]))


def stiffness_matrix(structure: Structure, genome: Mapping[str, float]) -> Array:
    """Return the stiffness matrix [6 n, 6 n] of n bodies at rest, with fixed driving rods.

    The coordinates of each body are three rotations (rad), then three displacements (m). ``genome``: as in
    :func:`loaded`.
    """
    w, n = structure.wiring, len(structure.bodies)
    group, state = loaded(structure, genome), at_rest(structure)
    Q, d = np.zeros((len(w.first), 9, LANES)), np.zeros((len(w.first), 3, LANES))
    relative_pose(w.first, w.second, w.a, w.b, state.R, state.p, Q, d)
    K = np.zeros((6 * n, 6 * n))
    for column in range(6 * n):
        x, out = np.zeros((n + 2, 6, LANES)), np.zeros((n + 2, 6, LANES))
        x[column // 6, column % 6] = 1.0
        tangent(w.first, w.second, w.a, w.b, group.stiffness, Q, d, x, out)
        K[:, column] = -out[:n, :, 0].ravel()
    return K


def spring_wrenches(structure: Structure, springs: Array, R: Array, p: Array) -> Array:
    """Return the static spring loads [n + 2, 6, W] (moment, then force) on n bodies and 2 rods, for W poses.

    ``springs`` [C, 6, W]: stiffness of C connectors; ``R`` [n + 2, 9, W]: rotation matrices, row by row; ``p`` [n + 2,
    3, W]: positions, m. W is LANES.
    """
    w = structure.wiring
    Q, d = np.zeros((len(w.first), 9, LANES)), np.zeros((len(w.first), 3, LANES))
    relative_pose(w.first, w.second, w.a, w.b, R, p, Q, d)
    still, wrench = np.zeros((len(p), 6, LANES)), np.zeros((len(p), 6, LANES))
    lost, stored = np.zeros(LANES), np.zeros(LANES)
    coupling, more = np.zeros((0, 9, LANES)), np.zeros((0, 6, LANES))
    connect(w.first, w.second, w.a, w.b, springs, 0 * springs, coupling, more, Q, d, still, wrench, lost, stored)
    return wrench


def displacement(K: Array, load: Array, held: tuple[int, ...] = ()) -> Array:
    """Return the small rotations (rad) and displacements (m) [n, 6] of n bodies under a load.

    ``K``: stiffness matrix of :func:`stiffness_matrix`; ``load`` [n, 6]: moments (N m) and forces (N); ``held``:
    indices of clamped bodies.
    """
    free = np.array([k for k in range(len(K)) if k // 6 not in held])
    u = np.zeros(len(K))
    u[free] = np.linalg.solve(K[np.ix_(free, free)], load.ravel()[free])
    return u.reshape(-1, 6)
