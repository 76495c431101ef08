"""Linearise the connectors: derivatives of the wrenches of springs and dampers by the bodies' poses and twists.

Frames A and B, the pose (Q, d) of B in A, and the arms a, b are those of :mod:`wingfit.sim.kernels.connectors`; x~ is
the matrix of the cross product with x. In the axes of frame A, a displacement xi of the bodies moves B by
eta = (phi, delta) = J xi and changes the relative twist r = J V by B eta. With the wrench (t, f) on B, the wrenches on
the bodies change by

    second: -J_2^T (D J dV + K_2 eta),    K_2 = K + D B - [[t~, 0], [f~, 0]],
    first:       E (D J dV + K_1 eta),    K_1 = K + D B + [[0, f~], [0, 0]],

K being minus the derivative of the spring's wrench and D the damping. The last terms are the geometric stiffness: the
wrench rotates with the body and moves with the end of the spring. The derivative is exact, so the matrix is not
symmetric. E = [[I, e~], [0, I]] with e = a + d takes a wrench at o_B to the first body, the same matrix with e = Q b to
the second.

The step solves for the change of the local coordinates xi, of rate xi' = V + A xi, A = [[-omega~ / 2, 0], [-v~, 0]] in
each body; its matrix is S = (M / l - dW/dV) (I - l A) - l dW/dxi with the mass matrix M, the wrenches W and l = h gamma
(h: step, gamma: coefficient of the Rosenbrock method). For the twist of body k, a connector has J A = B_k J.
"""

from __future__ import annotations

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.connectors import coupling_wrench, damper_wrench, relative_twist, spring_wrench
from wingfit.sim.kernels.jit import inlined, kernel
from wingfit.sim.kernels.lanes.matrices import (
    Nine,
    Six,
    Three,
    add_to_block,
    add_wrench,
    added,
    axial,
    co_stiffness,
    co_stiffness_matrix,
    columns_scaled,
    cross,
    extended,
    gyroscopic,
    less,
    load_inertia,
    load_matrix,
    load_vector,
    outer,
    plus,
    product,
    rows_scaled,
    scaled,
    set_block,
    skew,
    skew_times,
    times,
    times_skew,
    trace_minus,
    transposed,
    with_diagonal,
)
from wingfit.sim.kernels.lanes.vector import load, load1, store


@inlined
def spring_tangent(Q: Nine, d: Three, ko: Three, kt: Three) -> Six:
    """Return K (6 x 6): minus the derivative of the spring's wrench on the second body by the motion of its end there.

    The axes are those of the first body; Q, d: pose of that end; ``ko``, ``kt``: stiffness of rotation and translation.
    """
    S = product(columns_scaled(Q, kt), transposed(Q))
    P = scaled(0.5, plus(times_skew(S, d), scaled(-1.0, skew(times(S, d)))))
    oo = plus(trace_minus(columns_scaled(Q, co_stiffness(ko))), scaled(-1.0, skew_times(d, P)))
    return oo, transposed(P), P, scaled(0.5, with_diagonal(S, kt))


@inlined
def coupling_tangent(N: Nine, d: Three) -> Six:
    """Return the contribution to K of the coupling of rotation with translation (N, d: see ``coupling_wrench``)."""
    L = trace_minus(N)
    turned = plus(outer(d, axial(N)), times_skew(transposed(N), d))
    return scaled(-1.0, turned), transposed(L), L, scaled(0.0, L)


@inlined
def twist_tangent(g: Three, omega: Three, turning: Three) -> Six:
    """Return B (6 x 6): the derivative of the relative twist of a connector's ends by the motion of the second end.

    All vectors are in the first body's axes: ``g``, ``turning``: velocity and angular velocity of the second end;
    ``omega``: angular velocity of the first body.
    """
    return (scaled(-1.0, skew(turning)), scaled(0.0, skew(g)), scaled(-1.0, skew(g)), scaled(-1.0, skew(omega)))


@inlined
def damper_tangent(B: Six, omega: Three, v: Three, arm: Three, do: Three, dt: Three) -> Six:
    """Return D (B - B_k) for body k, which turns with ``omega`` and moves with ``v``; D = diag(do, dt).

    B and B_k are defined in this module. ``arm``: from the body's centre to the connector's end on the second body; all
    vectors are in the first body's axes.
    """
    oo = plus(B[0], scaled(0.5, skew(omega)))
    to = plus(B[2], plus(skew(v), scaled(-0.5, skew_times(arm, skew(omega)))))
    return rows_scaled(do, oo), B[1], rows_scaled(dt, to), rows_scaled(dt, B[3])


@inlined
def sum_of(A: Six, B: Six) -> Six:
    """Return A + B."""
    return plus(A[0], B[0]), plus(A[1], B[1]), plus(A[2], B[2]), plus(A[3], B[3])


@inlined
def complete(A: Six, length: float, do: Three, dt: Three) -> Six:
    """Return D + ``length`` A, with D = diag(do, dt)."""
    return (
        with_diagonal(scaled(length, A[0]), do),
        scaled(length, A[1]),
        scaled(length, A[2]),
        with_diagonal(scaled(length, A[3]), dt),
    )


@inlined
def moved(e: Three, A: Six, g: Three) -> Six:
    """Return E(e) A E(g)^T with E(e) = [[I, e~], [0, I]]: A transferred from one point to two others.

    ``e`` (for the rows) and ``g`` (for the columns) lead from these other points to the first.
    """
    a, c = plus(A[0], skew_times(e, A[2])), plus(A[1], skew_times(e, A[3]))
    return (plus(a, scaled(-1.0, times_skew(c, g))), c, plus(A[2], scaled(-1.0, times_skew(A[3], g))), A[3])


@inlined
def turned_left(sign: float, Q: Nine, A: Six) -> Six:
    """Return ``sign`` Q^T A, with Q applied to both halves of each column."""
    T = scaled(sign, transposed(Q))
    return product(T, A[0]), product(T, A[1]), product(T, A[2]), product(T, A[3])


@inlined
def turned_right(sign: float, A: Six, Q: Nine) -> Six:
    """Return ``sign`` A Q, with Q applied to both halves of each row."""
    T = scaled(sign, Q)
    return product(A[0], T), product(A[1], T), product(A[2], T), product(A[3], T)


@kernel
def start_blocks(
    mass: Array, inertia: Array, damping: Array, R: Array, V: Array, gravity: float, length: float, fill: Index,
    blocks: Array,
) -> None:  # fmt: skip
    """Set the diagonal ``blocks`` to the bodies' own part of S: inertia, gyroscopic terms, gravity, damping by the air.

    ``damping`` [N, W] (N s/m) acts along each body's normal; ``length``: l = h gamma, s. The blocks numbered ``fill``,
    which no connector sets, become zero.
    """
    for k in fill:
        for i in range(36):
            store(blocks, k, i, 0.0)
    for n in range(len(mass)):
        m, own = mass[n], load_inertia(inertia, n)
        up = (load(R, n, 6), load(R, n, 7), load(R, n, 8))
        omega, v = load_vector(V, n, 0), load_vector(V, n, 3)
        G, spin, slip = gyroscopic(own, omega), skew(omega), skew(v)
        # (M / l - dW/dV) (I - l A): moments, then forces, of which -m v~ and m v~ cancel
        oo = plus(scaled(1.0 / length, own), plus(G, scaled(0.5, times_skew(own, omega))))
        oo = plus(oo, scaled(0.5 * length, product(G, spin)))
        to = scaled(length * m, plus(skew_times(omega, slip), scaled(-0.5, product(slip, spin))))
        to = plus(to, scaled(length * m * gravity, skew(up)))
        tt = scaled(m, spin)
        normal, weight = load1(damping, n), load1(damping, n) * 0.0 + m / length
        tilt = length * normal
        to = (to[0], to[1], to[2], to[3], to[4], to[5], to[6] - tilt * v[1], to[7] + tilt * v[0], to[8])
        tt = with_diagonal(tt, (weight, weight, weight + normal))
        set_block(blocks, n, (oo, scaled(0.0, to), to, tt))


@kernel
def add_own_terms(
    mass: Array, inertia: Array, damping: Array, V: Array, factor: float, lead: Array, X: Array, wrench: Array
) -> None:
    """Add M (lead + ``factor`` X) - dW/dV X to ``wrench``, for the bodies' own wrenches W as in :func:`start_blocks`.

    ``lead``, X [N+2, 6, W]: vectors of the equation of a stage (:func:`wingfit.sim.kernels.integrate.solve_stage`).
    """
    for n in range(len(mass)):
        m, own, omega = mass[n], load_inertia(inertia, n), load_vector(V, n, 0)
        x, y, u, w = load_vector(X, n, 0), load_vector(X, n, 3), load_vector(lead, n, 0), load_vector(lead, n, 3)
        t = added(times(gyroscopic(own, omega), x), times(own, extended(u, factor, x)))
        f, g = cross(omega, y), cross(load_vector(V, n, 3), x)
        h = extended(added(less(f, g), w), factor, y)
        add_wrench(wrench, n, t, (m * h[0], m * h[1], m * h[2] + load1(damping, n) * y[2]))


@kernel
def add_connectors(
    first: Index, second: Index, lower: Index, upper: Index, a: Array, b: Array, K: Array, D: Array, coupling: Array,
    more: Array, more_k: Array, more_d: Array, Q_: Array, d_: Array, V: Array, length: float, blocks: Array,
) -> None:  # fmt: skip
    """Add the connectors' part of S to its diagonal blocks, and set its off-diagonal blocks.

    ``lower`` and ``upper`` [C] are the numbers of the blocks (second, first) and (first, second); upper is -1 where
    ``first`` is a driving rod, whose motion is known: there is no row for it, and its column is applied to the
    right-hand side. ``more``: additional wrench as in :func:`wingfit.sim.kernels.connectors.connect`; ``more_k``,
    ``more_d`` [C, 6, W]: minus its derivatives by displacement and twist along its own axes; all three may be empty.
    ``length``: l = h gamma, s; other arguments as in :func:`wingfit.sim.kernels.connectors.connect`.
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        Q, d = load_matrix(Q_, c), load_vector(d_, c, 0)
        ko, kt, do, dt = load_vector(K, c, 0), load_vector(K, c, 3), load_vector(D, c, 0), load_vector(D, c, 3)
        e = (a[c, 0] + d[0], a[c, 1] + d[1], a[c, 2] + d[2])
        arm = times(Q, (b[c, 0], b[c, 1], b[c, 2]))
        omega, velocity = load_vector(V, i, 0), load_vector(V, i, 3)
        turning = times(Q, load_vector(V, j, 0))
        rate, slide = relative_twist(Q, e, arm, omega, velocity, turning, load_vector(V, j, 3))
        t, f, _ = spring_wrench(Q, d, ko, kt)
        loss_t, loss_f = damper_wrench(rate, slide, do, dt)
        K_ = spring_tangent(Q, d, ko, kt)
        if len(coupling):
            N = product(Q, co_stiffness_matrix(load_matrix(coupling, c)))
            K_ = sum_of(K_, coupling_tangent(N, d))
            pull_t, pull_f, _ = coupling_wrench(N, d)
            t, f = added(t, pull_t), added(f, pull_f)
        t = (t[0] - loss_t[0], t[1] - loss_t[1], t[2] - loss_t[2])
        f = (f[0] - loss_f[0], f[1] - loss_f[1], f[2] - loss_f[2])
        if len(more):
            t, f = added(t, load_vector(more, c, 0)), added(f, load_vector(more, c, 3))
            extra_o, extra_t = load_vector(more_k, c, 0), load_vector(more_k, c, 3)
            K_ = (with_diagonal(K_[0], extra_o), K_[1], K_[2], with_diagonal(K_[3], extra_t))
            do, dt = added(do, load_vector(more_d, c, 0)), added(dt, load_vector(more_d, c, 3))
        g = added(added(slide, velocity), cross(omega, e))
        B = twist_tangent(g, omega, turning)
        by_first = sum_of(K_, damper_tangent(B, omega, velocity, e, do, dt))
        by_second = sum_of(K_, damper_tangent(B, turning, times(Q, load_vector(V, j, 3)), arm, do, dt))
        on_second = (scaled(-1.0, skew(t)), B[1], scaled(-1.0, skew(f)), B[1])
        on_first = (B[1], skew(f), B[1], B[1])
        Z = complete(sum_of(by_second, on_second), length, do, dt)
        add_to_block(blocks, j, turned_left(1.0, Q, turned_right(1.0, moved(arm, Z, arm), Q)))
        Z = complete(sum_of(by_first, on_second), length, do, dt)
        set_block(blocks, lower[c], turned_left(-1.0, Q, moved(arm, Z, e)))
        if upper[c] >= 0:
            Z = complete(sum_of(by_first, on_first), length, do, dt)
            add_to_block(blocks, i, moved(e, Z, e))
            Z = complete(sum_of(by_second, on_first), length, do, dt)
            set_block(blocks, upper[c], turned_right(-1.0, moved(e, Z, arm), Q))
