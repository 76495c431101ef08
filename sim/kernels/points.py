"""Wrenches that laws of effects apply at points of bodies, lane by lane, and their exact part of the step's matrix.

A point lies at the arm b of body i, at x = p + R b. A law gives, in the axes of the world, the wrench (m, f) there,
and K and D: minus its derivatives by the motion (rotation, displacement) and by the twist (angular velocity, velocity)
of the point. With E = [[I, b~], [0, I]], and all of these in the axes of the body, the wrench at the centre of mass is
E (m, f) and

    -dW/dV = E D E^T,    -dW/dxi = E (K + [[-m~, 0], [-f~, 0]] - D [[omega~, 0], [u~, 0]]) E^T,

u being the velocity of the point: the wrench and the twist keep their axes in the world while the body turns. The
matrix S of a step, l and A are those of :mod:`wingfit.sim.kernels.tangents`.
"""

from __future__ import annotations

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.arrays import Laws, Work
from wingfit.sim.kernels.jit import kernel
from wingfit.sim.kernels.lanes.matrices import (
    add_to_block,
    add_wrench,
    added,
    cross,
    load_block,
    load_matrix,
    load_vector,
    plus,
    product,
    scaled,
    set_block,
    skew,
    skew_times,
    store_matrix,
    store_vector,
    times,
    times_six,
    transposed,
)
from wingfit.sim.kernels.tangents import moved, turned_left, turned_right


@kernel
def follow_points(laws: Laws, work: Work) -> None:
    """Set in ``work`` the position, rotation and twist of all P points, in world axes.

    These are ``place`` [P, 3, W] (m), ``turn`` [P, 9, W] and ``point_twist`` [P, 6, W] (rad/s, m/s); ``laws`` has the
    bodies and arms of the points.
    """
    for k in range(len(laws.bodies)):
        i = laws.bodies[k]
        A, b, omega = load_matrix(work.R, i), load_vector(laws.arms, k, 0), load_vector(work.V, i, 0)
        store_matrix(work.turn, k, A)
        store_vector(work.place, k, 0, added(load_vector(work.p, i, 0), times(A, b)))
        store_vector(work.point_twist, k, 0, times(A, omega))
        store_vector(work.point_twist, k, 3, times(A, added(load_vector(work.V, i, 3), cross(omega, b))))


@kernel
def add_point_wrenches(laws: Laws, work: Work) -> None:
    """Add the wrenches ``work.point_wrench`` [P, 6, W] at the points, in world axes, to those of the bodies."""
    for k in range(len(laws.bodies)):
        back = transposed(load_matrix(work.R, laws.bodies[k]))
        m, f = times(back, load_vector(work.point_wrench, k, 0)), times(back, load_vector(work.point_wrench, k, 3))
        add_wrench(work.wrench, laws.bodies[k], added(m, cross(load_vector(laws.arms, k, 0), f)), f)


@kernel
def add_point_blocks(laws: Laws, work: Work, length: float) -> None:
    """Add the part of the step's matrix S that is due to wrenches at points, -dW/dV (I - l A) - l dW/dxi.

    It is added to ``work.blocks``; l is ``length`` = h gamma, the other symbols are those at the top of this module.
    -dW/dV of each point is stored in ``work.drag`` [P, 36, W]. Both terms together are E (D + l K + [[X, 0], [Y, 0]])
    E^T with (X, Y) = l (D (-omega~ / 2, b~ omega~ / 2 - omega~ b~) - (m~, f~)).
    """
    for k in range(len(laws.bodies)):
        i = laws.bodies[k]
        A, b, omega = load_matrix(work.R, i), load_vector(laws.arms, k, 0), load_vector(work.V, i, 0)
        K = turned_left(1.0, A, turned_right(1.0, load_block(work.point_k, k), A))
        D = turned_left(1.0, A, turned_right(1.0, load_block(work.point_d, k), A))
        back = transposed(A)
        m, f = times(back, load_vector(work.point_wrench, k, 0)), times(back, load_vector(work.point_wrench, k, 3))
        set_block(work.drag, k, moved(b, D, b))
        spin = scaled(-0.5, skew(omega))
        slide = plus(scaled(-1.0, skew_times(b, spin)), scaled(-1.0, skew_times(omega, skew(b))))
        X = plus(plus(product(D[0], spin), product(D[1], slide)), scaled(-1.0, skew(m)))
        Y = plus(plus(product(D[2], spin), product(D[3], slide)), scaled(-1.0, skew(f)))
        Z = (
            plus(D[0], scaled(length, plus(K[0], X))),
            plus(D[1], scaled(length, K[1])),
            plus(D[2], scaled(length, plus(K[2], Y))),
            plus(D[3], scaled(length, K[3])),
        )
        add_to_block(work.blocks, i, moved(b, Z, b))


@kernel
def add_point_terms(bodies: Index, drag: Array, X: Array, wrench: Array) -> None:
    """Add -dW/dV X to ``wrench`` [N+2, 6, W]; ``drag`` [P, 36, W]: -dW/dV of each point, on body ``bodies`` [P]."""
    for k in range(len(bodies)):
        i = bodies[k]
        t, f = times_six(load_block(drag, k), load_vector(X, i, 0), load_vector(X, i, 3))
        add_wrench(wrench, i, t, f)
