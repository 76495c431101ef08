"""Masses that effects add: masses fixed to a body, and added mass of the air, which couples the bodies of a strip.

Both are 6 x 6 matrices of pairs of bodies (i, j) in ``lanes.pairs``, with i = j for fixed masses.

**Fixed masses.** The kinetic energy is V . M V / 2, M constant in the body's frame. With (h, p) = M V the law of motion
is h' = h x omega + p x v, p' = p x omega, which keeps the energy exactly.

**Added mass.** A thin plate accelerates air by its motion along the normal only: q = (omega_x, omega_y, v_z) of its
bodies, v_z relative to the wind. The kinetic energy is the sum of q_i . N_ij q_j / 2 over pairs of bodies of a
strip and the wrench of the air is -N q', along the same three: pressure pushes along the normal. Kirchhoff's equations
of a body in a perfect fluid have two more terms, a force along the chord and Munk's moment, which together do no work.
They are omitted here: the force is edge suction, and with circulation the moment shifts the lift to the quarter chord
(Theodorsen 1935, NACA Report 496), where strips apply it anyway. The remainder is the noncirculatory part of thin
airfoil theory: in a stream U, m (h'' + U alpha') along the normal.

Both kinds enter as inertia: as explicit forces, air heavier than the wing would make the step unstable.
"""

from __future__ import annotations

from wingfit.records.array_types import Array
from wingfit.sim.kernels.arrays import Lanes, Setting, Work
from wingfit.sim.kernels.jit import inlined, kernel
from wingfit.sim.kernels.lanes.matrices import (
    Nine,
    Six,
    Three,
    add_to_block,
    add_wrench,
    added,
    cross,
    extended,
    less,
    load_block,
    load_matrix,
    load_vector,
    plus,
    product,
    scaled,
    skew,
    skew_times,
    times,
    times_six,
    times_skew,
    transposed,
)
from wingfit.sim.kernels.lanes.vector import load, load0, load1, store0


@inlined
def _across(masses: Array, k: int) -> Nine:
    """Return the nonzero 3 x 3 part of the added mass of pair ``k``: rotation about x and y, translation along z.

    ``masses`` [P, 36, W]: 6 x 6 matrices of P pairs of bodies, row by row.
    """
    return (
        load(masses, k, 0), load(masses, k, 1), load(masses, k, 5),
        load(masses, k, 6), load(masses, k, 7), load(masses, k, 11),
        load(masses, k, 30), load(masses, k, 31), load(masses, k, 35),
    )  # fmt: skip


@inlined
def _in_body(R: Array, n: int, wind: Array) -> Three:
    """Return the wind [3, W] (m/s, world) in the frame of body ``n``, whose rotation is R[n]."""
    return times(transposed(load_matrix(R, n)), (load1(wind, 0), load1(wind, 1), load1(wind, 2)))


@inlined
def _relative(V: Array, R: Array, n: int, wind: Array, air: bool) -> Three:
    """Return the velocity (m/s) of body ``n`` in its own frame; for added mass (``air``) relative to the wind."""
    v = load_vector(V, n, 3)
    return less(v, _in_body(R, n, wind)) if air else v


@kernel
def add_momentum(lanes: Lanes, setting: Setting, R: Array, V: Array, wrench: Array) -> None:
    """Add to ``wrench`` [N+2, 6, W] the gyroscopic terms of the effects' masses, and the weight of fixed masses.

    The first ``lanes.weighing`` pairs of bodies (i, j) are fixed masses, with i = j, and the others added mass.
    """
    for k in range(lanes.weighing):
        i, j = lanes.pairs[k, 0], lanes.pairs[k, 1]
        M, omega = load_block(lanes.masses, k), load_vector(V, i, 0)
        h, p = times_six(M, load_vector(V, j, 0), load_vector(V, j, 3))
        t, s, f = cross(h, omega), cross(p, load_vector(V, i, 3)), cross(p, omega)
        add_wrench(wrench, i, added(t, s), f)
        t, f = _weight(M, setting.gravity, R, i)
        add_wrench(wrench, i, t, f)
    for k in range(lanes.weighing, len(lanes.pairs)):
        j, N = lanes.pairs[k, 1], _across(lanes.masses, k)
        turn, w = load_vector(V, j, 0), _in_body(R, j, setting.wind)
        a = turn[1] * w[0] - turn[0] * w[1]  # the wind rotates in the frame of the body
        zero = 0.0 * a
        add_wrench(wrench, lanes.pairs[k, 0], (N[2] * a, N[5] * a, zero), (zero, zero, N[8] * a))


@inlined
def _first_moment(M: Six) -> Three:
    """Return mass times centre of mass of the 6 x 6 mass matrix M, from its upper right quarter."""
    return M[1][7], M[1][2], M[1][3]


@inlined
def _weight(M: Six, gravity: float, R: Array, i: int) -> tuple[Three, Three]:
    """Return moment and force of the weight of mass matrix M on body ``i``, in its frame."""
    g = (-gravity * load(R, i, 6), -gravity * load(R, i, 7), -gravity * load(R, i, 8))
    return cross(_first_moment(M), g), times(M[3], g)


@kernel
def add_mass_blocks(lanes: Lanes, setting: Setting, R: Array, V: Array, length: float, blocks: Array) -> None:
    """Add to ``blocks`` the effects' masses' part of S, (M / l - dW/dV) (I - l A) - l dW/dxi.

    S, A and l = ``length`` = h gamma (in s) are those of :mod:`wingfit.sim.kernels.tangents`; W is the wrench of the
    pair's mass matrix M.
    """
    for k in range(lanes.weighing):
        i = lanes.pairs[k, 0]
        M, omega, v = load_block(lanes.masses, k), load_vector(V, i, 0), load_vector(V, i, 3)
        h, p = times_six(M, omega, v)
        zero = scaled(0.0, M[0])
        own = (scaled(-1.0, skew(h)), scaled(-1.0, skew(p)), scaled(-1.0, skew(p)), zero)
        A = _by_twist(M, omega, v, 1.0 / length)
        A = (plus(A[0], own[0]), plus(A[1], own[1]), plus(A[2], own[2]), A[3])
        add_to_block(blocks, i, _with_motion(A, omega, v, length))
        turned = scaled(length * setting.gravity, skew((load(R, i, 6), load(R, i, 7), load(R, i, 8))))
        add_to_block(blocks, i, (skew_times(_first_moment(M), turned), zero, product(M[3], turned), zero))
    for k in range(lanes.weighing, len(lanes.pairs)):
        j, M = lanes.pairs[k, 1], load_block(lanes.masses, k)
        omega, w = load_vector(V, j, 0), _in_body(R, j, setting.wind)
        v, factor = load_vector(V, j, 3), 1.0 / length
        A = (scaled(factor, M[0]), scaled(factor, M[1]), scaled(factor, M[2]), scaled(factor, M[3]))
        joined = _with_motion(A, omega, less(v, w), length)
        add_to_block(blocks, lanes.pairs[k, 2], _with_wind(joined, M, omega, w, length))


@inlined
def _by_twist(M: Six, omega: Three, v: Three, factor: float) -> Six:
    """Return ``factor`` M + [[omega~, v~], [0, omega~]] M; x~: matrix of the cross product with x."""
    return (
        plus(scaled(factor, M[0]), plus(skew_times(omega, M[0]), skew_times(v, M[2]))),
        plus(scaled(factor, M[1]), plus(skew_times(omega, M[1]), skew_times(v, M[3]))),
        plus(scaled(factor, M[2]), skew_times(omega, M[2])),
        plus(scaled(factor, M[3]), skew_times(omega, M[3])),
    )


@inlined
def _with_motion(A: Six, omega: Three, v: Three, length: float) -> Six:
    """Return A [[I + l omega~ / 2, 0], [l v~, I]], where l is ``length`` and x~ the matrix of the cross product.

    This is A (I - l A_j) for a body j with the twist (omega, v), A_j as in :mod:`wingfit.sim.kernels.tangents`.
    """
    half = 0.5 * length
    return (
        plus(A[0], plus(scaled(half, times_skew(A[0], omega)), scaled(length, times_skew(A[1], v)))),
        A[1],
        plus(A[2], plus(scaled(half, times_skew(A[2], omega)), scaled(length, times_skew(A[3], v)))),
        A[3],
    )


@inlined
def _with_wind(A: Six, M: Six, omega: Three, w: Three, length: float) -> Six:
    """Add l M (omega~ w~ - w~ omega~ / 2), as the wind w turns in the body's frame, to A's columns of rotation."""
    turned = plus(scaled(length, skew_times(omega, skew(w))), scaled(-0.5 * length, skew_times(w, skew(omega))))
    return plus(A[0], product(M[1], turned)), A[1], plus(A[2], product(M[3], turned)), A[3]


@kernel
def add_mass_terms(
    lanes: Lanes, setting: Setting, R: Array, V: Array, factor: float, lead: Array, X: Array, wrench: Array
) -> None:
    """Add M (lead + ``factor`` X) - dW/dV X to ``wrench`` [N+2, 6, W]; M and W: the pairs' masses and their wrenches.

    ``lead``, X [N+2, 6, W]: vectors of the equation of a stage (:func:`wingfit.sim.kernels.integrate.solve_stage`).
    """
    for k in range(lanes.weighing):
        i, j = lanes.pairs[k, 0], lanes.pairs[k, 1]
        M, omega, v = load_block(lanes.masses, k), load_vector(V, i, 0), load_vector(V, i, 3)
        x, y = load_vector(X, j, 0), load_vector(X, j, 3)
        u, w = load_vector(lead, j, 0), load_vector(lead, j, 3)
        a, b = times_six(M, extended(u, factor, x), extended(w, factor, y))
        c, d = times_six(M, x, y)
        a, b = added(added(a, cross(omega, c)), cross(v, d)), added(b, cross(omega, d))
        h, p = times_six(M, load_vector(V, j, 0), load_vector(V, j, 3))
        x, y = load_vector(X, i, 0), load_vector(X, i, 3)
        add_wrench(wrench, i, less(less(a, cross(h, x)), cross(p, y)), less(b, cross(p, x)))
    for k in range(lanes.weighing, len(lanes.pairs)):
        i, j = lanes.pairs[k, 0], lanes.pairs[k, 1]
        N, w = _across(lanes.masses, k), _in_body(R, j, setting.wind)
        x = (load(X, j, 0), load(X, j, 1), load(X, j, 5))
        u = (load(lead, j, 0), load(lead, j, 1), load(lead, j, 5))
        blown = w[0] * x[1] - w[1] * x[0]  # change of the wind in the rotating frame of the body
        a = times(N, (u[0] + factor * x[0], u[1] + factor * x[1], u[2] + factor * x[2] - blown))
        zero = 0.0 * blown
        add_wrench(wrench, i, (a[0], a[1], zero), (zero, zero, a[2]))


@kernel
def add_energies(lanes: Lanes, setting: Setting, work: Work, kinetic: Array, potential: Array) -> None:
    """Add the kinetic energy of all effects' masses and the potential energy of fixed masses, [W] each, J."""
    R, V = work.R, work.V
    for k in range(len(lanes.pairs)):
        i, j, air = lanes.pairs[k, 0], lanes.pairs[k, 1], k >= lanes.weighing
        M, own = load_block(lanes.masses, k), _relative(V, R, i, setting.wind, air)
        h, q = times_six(M, load_vector(V, j, 0), _relative(V, R, j, setting.wind, air))
        omega = load_vector(V, i, 0)
        twice = h[0] * omega[0] + h[1] * omega[1] + h[2] * omega[2] + q[0] * own[0] + q[1] * own[1] + q[2] * own[2]
        store0(kinetic, load0(kinetic) + 0.5 * twice)
        if not air:
            s = _first_moment(M)
            height = load(R, i, 6) * s[0] + load(R, i, 7) * s[1] + load(R, i, 8) * s[2] + M[3][8] * load(work.p, i, 2)
            store0(potential, load0(potential) + setting.gravity * height)
