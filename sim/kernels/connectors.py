"""The 6-D springs and dampers between bodies (thesis Eqs. 4-7), lane by lane.

A connector joins frame A on body ``first`` (at arm a) to frame B on body ``second`` (at arm b), both aligned with
their bodies. Q = R_A^T R_B and d = R_A^T (o_B - o_A) are B's pose in A. Energies (physics of the spring):
V_o = -tr(G_o Q) + tr(G_o), V_t = 1/4 d^T K_t d + 1/4 d^T Q K_t Q^T d and, where rotation and translation are coupled,
V_c = tr(G_c Q^T d~), signed so that it is phi^T K_c d for small rotations phi. The wrench on B, in A's axes at o_B, is
minus their gradient; that on A balances it.
"""

from __future__ import annotations

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.jit import inlined, kernel
from wingfit.sim.kernels.lanes.matrices import (
    Nine,
    Three,
    axial,
    co_stiffness,
    co_stiffness_matrix,
    cross,
    load_matrix,
    load_vector,
    product,
    scaled,
    times,
    trace_minus,
    transposed,
)
from wingfit.sim.kernels.lanes.vector import Vector, load, load0, store, store0


@kernel
def relative_pose(first: Index, second: Index, a: Array, b: Array, R: Array, p: Array, Q: Array, d: Array) -> None:
    """Q [C, 9, W] and d [C, 3, W] of every connector."""
    for c in range(len(first)):
        i, j = first[c], second[c]
        ax, ay, az = a[c, 0], a[c, 1], a[c, 2]
        bx, by, bz = b[c, 0], b[c, 1], b[c, 2]
        i0, i1, i2 = load(R, i, 0), load(R, i, 1), load(R, i, 2)
        i3, i4, i5 = load(R, i, 3), load(R, i, 4), load(R, i, 5)
        i6, i7, i8 = load(R, i, 6), load(R, i, 7), load(R, i, 8)
        j0, j1, j2 = load(R, j, 0), load(R, j, 1), load(R, j, 2)
        j3, j4, j5 = load(R, j, 3), load(R, j, 4), load(R, j, 5)
        j6, j7, j8 = load(R, j, 6), load(R, j, 7), load(R, j, 8)
        x = load(p, j, 0) - load(p, i, 0) + j0 * bx + j1 * by + j2 * bz
        y = load(p, j, 1) - load(p, i, 1) + j3 * bx + j4 * by + j5 * bz
        z = load(p, j, 2) - load(p, i, 2) + j6 * bx + j7 * by + j8 * bz
        store(d, c, 0, i0 * x + i3 * y + i6 * z - ax)
        store(d, c, 1, i1 * x + i4 * y + i7 * z - ay)
        store(d, c, 2, i2 * x + i5 * y + i8 * z - az)
        store(Q, c, 0, i0 * j0 + i3 * j3 + i6 * j6)
        store(Q, c, 1, i0 * j1 + i3 * j4 + i6 * j7)
        store(Q, c, 2, i0 * j2 + i3 * j5 + i6 * j8)
        store(Q, c, 3, i1 * j0 + i4 * j3 + i7 * j6)
        store(Q, c, 4, i1 * j1 + i4 * j4 + i7 * j7)
        store(Q, c, 5, i1 * j2 + i4 * j5 + i7 * j8)
        store(Q, c, 6, i2 * j0 + i5 * j3 + i8 * j6)
        store(Q, c, 7, i2 * j1 + i5 * j4 + i8 * j7)
        store(Q, c, 8, i2 * j2 + i5 * j5 + i8 * j8)


@inlined
def spring_wrench(Q: Nine, d: Three, ko: Three, kt: Three) -> tuple[Three, Three, Vector]:
    """Moment and force of the spring on B in A's axes at o_B, and its energy (thesis Eqs. 5-7)."""
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
    """Moment, force and energy of the coupling stiffness, with N = Q G_c: V_c = n . d for n~ = N - N^T."""
    n = axial(N)
    t = times(transposed(trace_minus(N)), d)
    return (-t[0], -t[1], -t[2]), (-n[0], -n[1], -n[2]), n[0] * d[0] + n[1] * d[1] + n[2] * d[2]


@inlined
def relative_twist(
    Q: Nine, e: Three, arm: Three, omega: Three, velocity: Three, turning: Three, v: Three
) -> tuple[Three, Three]:
    """Angular and linear velocity of B relative to A at o_B, in A's axes.

    ``omega``, ``velocity`` are the first body's; ``turning`` is the second's angular velocity in A's axes, ``v`` its
    velocity in its own; e and ``arm`` lead from the two centres to o_B, in A's axes.
    """
    there, here, moving = cross(turning, arm), cross(omega, e), times(Q, v)
    return (
        (turning[0] - omega[0], turning[1] - omega[1], turning[2] - omega[2]),
        (
            moving[0] + there[0] - velocity[0] - here[0],
            moving[1] + there[1] - velocity[1] - here[1],
            moving[2] + there[2] - velocity[2] - here[2],
        ),
    )


@inlined
def damper_wrench(rate: Three, slide: Three, do: Three, dt: Three) -> tuple[Three, Three]:
    """Moment and force of the damper against the motion (thesis Eq. 4)."""
    return ((do[0] * rate[0], do[1] * rate[1], do[2] * rate[2]), (dt[0] * slide[0], dt[1] * slide[1], dt[2] * slide[2]))


@inlined
def add_wrench(wrench: Array, n: int, t: Three, f: Three) -> None:
    """Add a wrench to that of body n."""
    store(wrench, n, 0, load(wrench, n, 0) + t[0])
    store(wrench, n, 1, load(wrench, n, 1) + t[1])
    store(wrench, n, 2, load(wrench, n, 2) + t[2])
    store(wrench, n, 3, load(wrench, n, 3) + f[0])
    store(wrench, n, 4, load(wrench, n, 4) + f[1])
    store(wrench, n, 5, load(wrench, n, 5) + f[2])


@kernel
def connect(
    first: Index,
    second: Index,
    a: Array,
    b: Array,
    K: Array,
    D: Array,
    coupling: Array,
    more: Array,
    Q_: Array,
    d_: Array,
    V: Array,
    wrench: Array,
    dissipated: Array,
    stored: Array,
) -> None:
    """Add spring and damper wrenches to both bodies; add up the power lost in dampers and the energy of springs.

    K, D [C, 6, W]: stiffness and damping (rotation about x, y, z, then translation along x, y, z of A); coupling
    [C, 9, W]: the symmetric K_c between them, row by row, and ``more`` [C, 6, W]: another wrench on the second body;
    both may be empty.
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        Q, d = load_matrix(Q_, c), load_vector(d_, c, 0)
        t, f, energy = spring_wrench(Q, d, load_vector(K, c, 0), load_vector(K, c, 3))
        if len(coupling):
            joint = coupling_wrench(product(Q, co_stiffness_matrix(load_matrix(coupling, c))), d)
            t = (t[0] + joint[0][0], t[1] + joint[0][1], t[2] + joint[0][2])
            f = (f[0] + joint[1][0], f[1] + joint[1][1], f[2] + joint[1][2])
            energy = energy + joint[2]
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
            t = (t[0] + load(more, c, 0), t[1] + load(more, c, 1), t[2] + load(more, c, 2))
            f = (f[0] + load(more, c, 3), f[1] + load(more, c, 4), f[2] + load(more, c, 5))
        store0(dissipated, load0(dissipated) + loss)
        store0(stored, load0(stored) + energy)
        m = cross(e, f)
        add_wrench(wrench, i, (-t[0] - m[0], -t[1] - m[1], -t[2] - m[2]), (-f[0], -f[1], -f[2]))
        m = cross(arm, f)
        back = transposed(Q)
        add_wrench(wrench, j, times(back, (t[0] + m[0], t[1] + m[1], t[2] + m[2])), times(back, f))


@kernel
def twists(first: Index, second: Index, a: Array, b: Array, Q: Array, d: Array, V: Array, out: Array) -> None:
    """Twist [C, 6, W] of each second body relative to the first at o_B, in A's axes: J V."""
    for c in range(len(first)):
        i, j = first[c], second[c]
        q, x = load_matrix(Q, c), load_vector(d, c, 0)
        e, arm = (a[c, 0] + x[0], a[c, 1] + x[1], a[c, 2] + x[2]), times(q, (b[c, 0], b[c, 1], b[c, 2]))
        rate, slide = relative_twist(
            q, e, arm, load_vector(V, i, 0), load_vector(V, i, 3), times(q, load_vector(V, j, 0)), load_vector(V, j, 3)
        )
        for k in range(3):
            store(out, c, k, rate[k])
            store(out, c, 3 + k, slide[k])


@kernel
def add_turned(
    first: Index, second: Index, a: Array, b: Array, Q: Array, d: Array, V: Array, X: Array, out: Array
) -> None:
    """Add to ``out`` [C, 6, W] the change of the relative twists with the pose, for bodies' displacements X: B J X."""
    for c in range(len(first)):
        i, j = first[c], second[c]
        q, x = load_matrix(Q, c), load_vector(d, c, 0)
        e, arm = (a[c, 0] + x[0], a[c, 1] + x[1], a[c, 2] + x[2]), times(q, (b[c, 0], b[c, 1], b[c, 2]))
        omega, turning = load_vector(V, i, 0), times(q, load_vector(V, j, 0))
        phi, delta = relative_twist(
            q, e, arm, load_vector(X, i, 0), load_vector(X, i, 3), times(q, load_vector(X, j, 0)), load_vector(X, j, 3)
        )
        there, moving = cross(turning, arm), times(q, load_vector(V, j, 3))
        g = (moving[0] + there[0], moving[1] + there[1], moving[2] + there[2])
        t, f, h = cross(turning, phi), cross(g, phi), cross(omega, delta)
        for k in range(3):
            store(out, c, k, load(out, c, k) - t[k])
            store(out, c, 3 + k, load(out, c, 3 + k) - f[k] - h[k])


@kernel
def push_apart(first: Index, second: Index, a: Array, b: Array, Q: Array, d: Array, push: Array, wrench: Array) -> None:
    """Subtract J^T times ``push`` [C, 6, W], a wrench against the second body's motion, from the bodies' wrenches."""
    for c in range(len(first)):
        i, j = first[c], second[c]
        q, x = load_matrix(Q, c), load_vector(d, c, 0)
        e, arm = (a[c, 0] + x[0], a[c, 1] + x[1], a[c, 2] + x[2]), times(q, (b[c, 0], b[c, 1], b[c, 2]))
        t, f = load_vector(push, c, 0), load_vector(push, c, 3)
        m = cross(e, f)
        add_wrench(wrench, i, (t[0] + m[0], t[1] + m[1], t[2] + m[2]), f)
        m, back = cross(arm, f), scaled(-1.0, transposed(q))
        add_wrench(wrench, j, times(back, (t[0] + m[0], t[1] + m[1], t[2] + m[2])), times(back, f))


@kernel
def tangent(
    first: Index, second: Index, a: Array, b: Array, C: Array, Q: Array, d: Array, X: Array, out: Array
) -> None:
    """Subtract J^T C J X from ``out`` for bodies' motions X [N, 6, W]; C [C, 6, W] as K.

    J maps twists of the bodies to the relative twist of B in A. This is the material stiffness (or damping) only.
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        ax, ay, az = a[c, 0], a[c, 1], a[c, 2]
        bx, by, bz = b[c, 0], b[c, 1], b[c, 2]
        q0, q1, q2 = load(Q, c, 0), load(Q, c, 1), load(Q, c, 2)
        q3, q4, q5 = load(Q, c, 3), load(Q, c, 4), load(Q, c, 5)
        q6, q7, q8 = load(Q, c, 6), load(Q, c, 7), load(Q, c, 8)
        ex, ey, ez = ax + load(d, c, 0), ay + load(d, c, 1), az + load(d, c, 2)
        ox, oy, oz = load(X, i, 0), load(X, i, 1), load(X, i, 2)
        wx, wy, wz = load(X, j, 0), load(X, j, 1), load(X, j, 2)
        vx = load(X, j, 3) + wy * bz - wz * by
        vy = load(X, j, 4) + wz * bx - wx * bz
        vz = load(X, j, 5) + wx * by - wy * bx
        tx = load(C, c, 0) * (q0 * wx + q1 * wy + q2 * wz - ox)
        ty = load(C, c, 1) * (q3 * wx + q4 * wy + q5 * wz - oy)
        tz = load(C, c, 2) * (q6 * wx + q7 * wy + q8 * wz - oz)
        fx = load(C, c, 3) * (q0 * vx + q1 * vy + q2 * vz - load(X, i, 3) - (oy * ez - oz * ey))
        fy = load(C, c, 4) * (q3 * vx + q4 * vy + q5 * vz - load(X, i, 4) - (oz * ex - ox * ez))
        fz = load(C, c, 5) * (q6 * vx + q7 * vy + q8 * vz - load(X, i, 5) - (ox * ey - oy * ex))
        store(out, i, 0, load(out, i, 0) + tx + ey * fz - ez * fy)
        store(out, i, 1, load(out, i, 1) + ty + ez * fx - ex * fz)
        store(out, i, 2, load(out, i, 2) + tz + ex * fy - ey * fx)
        store(out, i, 3, load(out, i, 3) + fx)
        store(out, i, 4, load(out, i, 4) + fy)
        store(out, i, 5, load(out, i, 5) + fz)
        sx, sy, sz = q0 * fx + q3 * fy + q6 * fz, q1 * fx + q4 * fy + q7 * fz, q2 * fx + q5 * fy + q8 * fz
        store(out, j, 0, load(out, j, 0) - (q0 * tx + q3 * ty + q6 * tz + by * sz - bz * sy))
        store(out, j, 1, load(out, j, 1) - (q1 * tx + q4 * ty + q7 * tz + bz * sx - bx * sz))
        store(out, j, 2, load(out, j, 2) - (q2 * tx + q5 * ty + q8 * tz + bx * sy - by * sx))
        store(out, j, 3, load(out, j, 3) - sx)
        store(out, j, 4, load(out, j, 4) - sy)
        store(out, j, 5, load(out, j, 5) - sz)
