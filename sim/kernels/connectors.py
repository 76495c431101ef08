"""The 6-D springs and dampers between bodies (van der Grinten's thesis, Eqs. 4-7), for W individuals at a time.

A connector joins frame A on body ``first`` (at the arm a from its centre of mass) to frame B on body ``second`` (at arm
b), both aligned with their bodies. Q = R_A^T R_B and d = R_A^T (o_B - o_A) are B's pose in A; o_A, o_B are the origins
of the frames, K_o, K_t, K_c the stiffness of rotation, of translation and of the coupling between them, and G = tr(K) /
2 - K for each. Energies of the spring: V_o = -tr(G_o Q) + tr(G_o), V_t = 1/4 d^T K_t d + 1/4 d^T Q K_t Q^T d and, where
rotation and translation are coupled, V_c = tr(G_c Q^T d~), signed so that it is phi^T K_c d for small rotations phi.
The wrench on B, in A's axes at o_B, is minus their gradient; that on A balances it.
"""

from __future__ import annotations

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.jit import inlined, kernel
from wingfit.sim.kernels.lanes.matrices import (
    Nine,
    Three,
    add_wrench,
    added,
    axial,
    co_stiffness,
    co_stiffness_matrix,
    cross,
    less,
    load_matrix,
    load_vector,
    negative,
    product,
    scaled,
    store_matrix,
    store_vector,
    times,
    trace_minus,
    transposed,
)
from wingfit.sim.kernels.lanes.vector import Vector, load, load0, store, store0


@kernel
def relative_pose(first: Index, second: Index, a: Array, b: Array, R: Array, p: Array, Q: Array, d: Array) -> None:
    """Set rotation Q [C, 9, W] and position d [C, 3, W] (m) of frame B relative to frame A, for each of C connectors.

    A and B are the ends of the connector on the bodies ``first`` and ``second`` [C], at the arms ``a``, ``b`` [C, 3]
    (m) from the centres of mass, and aligned with the bodies; R, p: poses of all bodies.
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        back, B, bx, by, bz = transposed(load_matrix(R, i)), load_matrix(R, j), b[c, 0], b[c, 1], b[c, 2]
        x = load(p, j, 0) - load(p, i, 0) + B[0] * bx + B[1] * by + B[2] * bz
        y = load(p, j, 1) - load(p, i, 1) + B[3] * bx + B[4] * by + B[5] * bz
        z = load(p, j, 2) - load(p, i, 2) + B[6] * bx + B[7] * by + B[8] * bz
        store_vector(d, c, 0, less(times(back, (x, y, z)), (a[c, 0], a[c, 1], a[c, 2])))
        store_matrix(Q, c, product(back, B))


@inlined
def spring_wrench(Q: Nine, d: Three, ko: Three, kt: Three) -> tuple[Three, Three, Vector]:
    """Return the moment and force of the spring on the second body, and its energy, by thesis Eqs. 5-7.

    The wrench acts at the spring's end B there, in the axes of its end A on the first body; Q, d: pose of B in A;
    ``ko``, ``kt``: stiffness of rotation about and of translation along these axes (N m/rad, N/m).
    """
    g = co_stiffness(ko)
    x, y, z = d
    u = (
        kt[0] * (Q[0] * x + Q[3] * y + Q[6] * z),
        kt[1] * (Q[1] * x + Q[4] * y + Q[7] * z),
        kt[2] * (Q[2] * x + Q[5] * y + Q[8] * z),
    )
    s = times(Q, u)  # Q K_t Q^T d
    bend = cross(d, s)
    t = (
        Q[5] * g[2] - Q[7] * g[1] + 0.5 * bend[0],
        Q[6] * g[0] - Q[2] * g[2] + 0.5 * bend[1],
        Q[1] * g[1] - Q[3] * g[0] + 0.5 * bend[2],
    )
    f = (-0.5 * (kt[0] * x + s[0]), -0.5 * (kt[1] * y + s[1]), -0.5 * (kt[2] * z + s[2]))
    energy = g[0] * (1.0 - Q[0]) + g[1] * (1.0 - Q[4]) + g[2] * (1.0 - Q[8])
    return t, f, energy - 0.5 * (f[0] * x + f[1] * y + f[2] * z)


@inlined
def coupling_wrench(N: Nine, d: Three) -> tuple[Three, Three, Vector]:
    """Return what :func:`spring_wrench` does, for the stiffness that couples rotation with translation.

    N = Q G_c, where G_c is the coupling's co-stiffness; d: position of B in A. The energy is n . d, where n~ = N - N^T.
    """
    n = axial(N)
    t = times(transposed(trace_minus(N)), d)
    return negative(t), negative(n), n[0] * d[0] + n[1] * d[1] + n[2] * d[2]


@inlined
def relative_twist(
    Q: Nine, e: Three, arm: Three, omega: Three, velocity: Three, turning: Three, v: Three
) -> tuple[Three, Three]:
    """Return angular and linear velocity of the second body relative to the first, at the connector's end there.

    All vectors are in the first body's axes, except ``v``, the second body's velocity in its own: ``omega``,
    ``velocity``: twist of the first body; ``turning``: angular velocity of the second; ``e`` and ``arm``: from the
    centres of the first and of the second body to that end (m). Q: rotation of the second body relative to the first.
    """
    moving = added(times(Q, v), cross(turning, arm))
    return less(turning, omega), less(less(moving, velocity), cross(omega, e))


@inlined
def damper_wrench(rate: Three, slide: Three, do: Three, dt: Three) -> tuple[Three, Three]:
    """Return the moment ``do`` times ``rate`` (rad/s) and the force ``dt`` times ``slide`` (m/s), axis by axis (Eq. 4).

    The damper exerts minus these on the second body.
    """
    return ((do[0] * rate[0], do[1] * rate[1], do[2] * rate[2]), (dt[0] * slide[0], dt[1] * slide[1], dt[2] * slide[2]))


@kernel
def connect(
    first: Index, second: Index, a: Array, b: Array, K: Array, D: Array, coupling: Array, more: Array, Q_: Array,
    d_: Array, V: Array, wrench: Array, dissipated: Array, stored: Array,
) -> None:  # fmt: skip
    """Add the wrenches of springs and dampers to ``wrench`` [N+2, 6, W] of both bodies of every connector.

    K, D [C, 6, W]: stiffness and damping (rotation about x, y, z, then translation along x, y, z of A); ``coupling``
    [C, 9, W]: the symmetric stiffness K_c between rotation and translation, row by row, and ``more`` [C, 6, W]: another
    wrench on the second body; both may be empty. ``Q_``, ``d_``: from :func:`relative_pose`. The power lost in the
    dampers is added to ``dissipated`` [W] (W), the energy of the springs to ``stored`` [W] (J).
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        Q, d = load_matrix(Q_, c), load_vector(d_, c, 0)
        t, f, energy = spring_wrench(Q, d, load_vector(K, c, 0), load_vector(K, c, 3))
        if len(coupling):
            joint = coupling_wrench(product(Q, co_stiffness_matrix(load_matrix(coupling, c))), d)
            t, f, energy = added(t, joint[0]), added(f, joint[1]), energy + joint[2]
        e = (a[c, 0] + d[0], a[c, 1] + d[1], a[c, 2] + d[2])
        arm = times(Q, (b[c, 0], b[c, 1], b[c, 2]))
        turning = times(Q, load_vector(V, j, 0))
        rate, slide = relative_twist(
            Q, e, arm, load_vector(V, i, 0), load_vector(V, i, 3), turning, load_vector(V, j, 3)
        )
        loss_t, loss_f = damper_wrench(rate, slide, load_vector(D, c, 0), load_vector(D, c, 3))
        loss = loss_t[0] * rate[0] + loss_t[1] * rate[1] + loss_t[2] * rate[2]
        loss += loss_f[0] * slide[0] + loss_f[1] * slide[1] + loss_f[2] * slide[2]
        t = (t[0] - loss_t[0], t[1] - loss_t[1], t[2] - loss_t[2])
        f = (f[0] - loss_f[0], f[1] - loss_f[1], f[2] - loss_f[2])
        if len(more):
            t, f = added(t, load_vector(more, c, 0)), added(f, load_vector(more, c, 3))
        store0(dissipated, load0(dissipated) + loss)
        store0(stored, load0(stored) + energy)
        add_wrench(wrench, i, less(negative(t), cross(e, f)), negative(f))
        back = transposed(Q)
        add_wrench(wrench, j, times(back, added(t, cross(arm, f))), times(back, f))


@kernel
def twists(first: Index, second: Index, a: Array, b: Array, Q: Array, d: Array, V: Array, out: Array) -> None:
    """Set ``out`` [C, 6, W] to the :func:`relative_twist` of each connector for the bodies' twists V [N+2, 6, W]."""
    for c in range(len(first)):
        i, j = first[c], second[c]
        q, x = load_matrix(Q, c), load_vector(d, c, 0)
        e, arm = (a[c, 0] + x[0], a[c, 1] + x[1], a[c, 2] + x[2]), times(q, (b[c, 0], b[c, 1], b[c, 2]))
        rate, slide = relative_twist(
            q, e, arm, load_vector(V, i, 0), load_vector(V, i, 3), times(q, load_vector(V, j, 0)), load_vector(V, j, 3)
        )
        store_vector(out, c, 0, rate)
        store_vector(out, c, 3, slide)


@kernel
def add_turned(
    first: Index, second: Index, a: Array, b: Array, Q: Array, d: Array, V: Array, X: Array, out: Array
) -> None:
    """Add to ``out`` [C, 6, W] the change B J X of the relative twists that small displacements X cause.

    X, V [N+2, 6, W]: displacements and twists of the bodies; the matrices B and J are those of
    :mod:`wingfit.sim.kernels.tangents`.
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        q, x = load_matrix(Q, c), load_vector(d, c, 0)
        e, arm = (a[c, 0] + x[0], a[c, 1] + x[1], a[c, 2] + x[2]), times(q, (b[c, 0], b[c, 1], b[c, 2]))
        omega, turning = load_vector(V, i, 0), times(q, load_vector(V, j, 0))
        phi, delta = relative_twist(
            q, e, arm, load_vector(X, i, 0), load_vector(X, i, 3), times(q, load_vector(X, j, 0)), load_vector(X, j, 3)
        )
        g = added(times(q, load_vector(V, j, 3)), cross(turning, arm))
        store_vector(out, c, 0, less(load_vector(out, c, 0), cross(turning, phi)))
        store_vector(out, c, 3, less(less(load_vector(out, c, 3), cross(g, phi)), cross(omega, delta)))


@kernel
def push_apart(first: Index, second: Index, a: Array, b: Array, Q: Array, d: Array, push: Array, wrench: Array) -> None:
    """Subtract the wrench ``push`` [C, 6, W] from that on each second body, and add it to that on the first.

    ``push`` acts at the connector's end on the second body, in the first body's axes; ``wrench`` [N+2, 6, W], changed
    in place, at the bodies' centres in their own axes.
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        q, x = load_matrix(Q, c), load_vector(d, c, 0)
        e, arm = (a[c, 0] + x[0], a[c, 1] + x[1], a[c, 2] + x[2]), times(q, (b[c, 0], b[c, 1], b[c, 2]))
        t, f, back = load_vector(push, c, 0), load_vector(push, c, 3), scaled(-1.0, transposed(q))
        add_wrench(wrench, i, added(t, cross(e, f)), f)
        add_wrench(wrench, j, times(back, added(t, cross(arm, f))), times(back, f))


@kernel
def tangent(
    first: Index, second: Index, a: Array, b: Array, C: Array, Q: Array, d: Array, X: Array, out: Array
) -> None:
    """Subtract J^T C J X from ``out`` [N+2, 6, W], for twists or displacements X [N+2, 6, W] of the bodies.

    J maps motions of the bodies to the relative motion of B in A; C [C, 6, W], stiffness or damping, is diagonal. Terms
    that arise because the wrench turns with the bodies (geometric stiffness) are not included.
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        q, bx, by, bz = load_matrix(Q, c), b[c, 0], b[c, 1], b[c, 2]
        ex, ey, ez = a[c, 0] + load(d, c, 0), a[c, 1] + load(d, c, 1), a[c, 2] + load(d, c, 2)
        omega, (wx, wy, wz) = load_vector(X, i, 0), load_vector(X, j, 0)
        vx = load(X, j, 3) + wy * bz - wz * by
        vy = load(X, j, 4) + wz * bx - wx * bz
        vz = load(X, j, 5) + wx * by - wy * bx
        rate = less(times(q, (wx, wy, wz)), omega)
        slide = less(less(times(q, (vx, vy, vz)), load_vector(X, i, 3)), cross(omega, (ex, ey, ez)))
        t, f = damper_wrench(rate, slide, load_vector(C, c, 0), load_vector(C, c, 3))
        (tx, ty, tz), (fx, fy, fz), back = t, f, transposed(q)
        store(out, i, 0, load(out, i, 0) + tx + ey * fz - ez * fy)
        store(out, i, 1, load(out, i, 1) + ty + ez * fx - ex * fz)
        store(out, i, 2, load(out, i, 2) + tz + ex * fy - ey * fx)
        store_vector(out, i, 3, added(load_vector(out, i, 3), f))
        (sx, sy, sz), u = times(back, f), times(back, t)
        store(out, j, 0, load(out, j, 0) - (u[0] + by * sz - bz * sy))
        store(out, j, 1, load(out, j, 1) - (u[1] + bz * sx - bx * sz))
        store(out, j, 2, load(out, j, 2) - (u[2] + bx * sy - by * sx))
        store_vector(out, j, 3, less(load_vector(out, j, 3), (sx, sy, sz)))
