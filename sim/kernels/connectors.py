"""The 6-D springs and dampers between bodies (thesis Eqs. 4-7), lane by lane.

A connector joins frame A on body ``first`` (at arm a) to frame B on body ``second`` (at arm b), both aligned with
their bodies. Q = R_A^T R_B and d = R_A^T (o_B - o_A) are B's pose in A. Energies (physics of the spring):
V_o = -tr(G_o Q) + tr(G_o), V_t = 1/4 d^T K_t d + 1/4 d^T Q K_t Q^T d. The wrench on B, in A's axes at o_B, is minus
their gradient; that on A balances it: force and moment vanish in sum, the forces being d apart.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim.kernels.jit import kernel
from sim.kernels.vector import load, load0, store, store0

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


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


@kernel
def connect(
    first: Index,
    second: Index,
    a: Array,
    b: Array,
    K: Array,
    D: Array,
    Q: Array,
    d: Array,
    V: Array,
    wrench: Array,
    dissipated: Array,
    stored: Array,
) -> None:
    """Add spring and damper wrenches to both bodies; power lost in dampers and energy in springs go to the lanes.

    K, D [C, 6, W]: stiffness and damping (rotation about x, y, z, then translation along x, y, z of A).
    """
    for c in range(len(first)):
        i, j = first[c], second[c]
        ax, ay, az = a[c, 0], a[c, 1], a[c, 2]
        bx, by, bz = b[c, 0], b[c, 1], b[c, 2]
        q0, q1, q2 = load(Q, c, 0), load(Q, c, 1), load(Q, c, 2)
        q3, q4, q5 = load(Q, c, 3), load(Q, c, 4), load(Q, c, 5)
        q6, q7, q8 = load(Q, c, 6), load(Q, c, 7), load(Q, c, 8)
        x, y, z = load(d, c, 0), load(d, c, 1), load(d, c, 2)
        ex, ey, ez = ax + x, ay + y, az + z
        # co-stiffness G = tr(K)/2 - K (Eq. 5)
        kx, ky, kz = load(K, c, 0), load(K, c, 1), load(K, c, 2)
        gx, gy, gz = 0.5 * (ky + kz - kx), 0.5 * (kz + kx - ky), 0.5 * (kx + ky - kz)
        tx, ty, tz = q5 * gz - q7 * gy, q6 * gx - q2 * gz, q1 * gy - q3 * gx
        energy = gx * (1.0 - q0) + gy * (1.0 - q4) + gz * (1.0 - q8)
        # S d = Q K_t Q^T d
        kx, ky, kz = load(K, c, 3), load(K, c, 4), load(K, c, 5)
        ux = kx * (q0 * x + q3 * y + q6 * z)
        uy = ky * (q1 * x + q4 * y + q7 * z)
        uz = kz * (q2 * x + q5 * y + q8 * z)
        sx, sy, sz = q0 * ux + q1 * uy + q2 * uz, q3 * ux + q4 * uy + q5 * uz, q6 * ux + q7 * uy + q8 * uz
        tx += 0.5 * (y * sz - z * sy)
        ty += 0.5 * (z * sx - x * sz)
        tz += 0.5 * (x * sy - y * sx)
        fx, fy, fz = -0.5 * (kx * x + sx), -0.5 * (ky * y + sy), -0.5 * (kz * z + sz)
        energy += -0.5 * (fx * x + fy * y + fz * z)
        # relative twist of B in A, at o_B
        ox, oy, oz = load(V, i, 0), load(V, i, 1), load(V, i, 2)
        wx, wy, wz = load(V, j, 0), load(V, j, 1), load(V, j, 2)
        vx = load(V, j, 3) + wy * bz - wz * by
        vy = load(V, j, 4) + wz * bx - wx * bz
        vz = load(V, j, 5) + wx * by - wy * bx
        rx = q0 * wx + q1 * wy + q2 * wz - ox
        ry = q3 * wx + q4 * wy + q5 * wz - oy
        rz = q6 * wx + q7 * wy + q8 * wz - oz
        ux = q0 * vx + q1 * vy + q2 * vz - load(V, i, 3) - (oy * ez - oz * ey)
        uy = q3 * vx + q4 * vy + q5 * vz - load(V, i, 4) - (oz * ex - ox * ez)
        uz = q6 * vx + q7 * vy + q8 * vz - load(V, i, 5) - (ox * ey - oy * ex)
        sx, sy, sz = load(D, c, 0) * rx, load(D, c, 1) * ry, load(D, c, 2) * rz
        loss = sx * rx + sy * ry + sz * rz
        tx, ty, tz = tx - sx, ty - sy, tz - sz
        sx, sy, sz = load(D, c, 3) * ux, load(D, c, 4) * uy, load(D, c, 5) * uz
        loss += sx * ux + sy * uy + sz * uz
        fx, fy, fz = fx - sx, fy - sy, fz - sz
        store0(dissipated, load0(dissipated) + loss)
        store0(stored, load0(stored) + energy)
        store(wrench, i, 0, load(wrench, i, 0) - (tx + ey * fz - ez * fy))
        store(wrench, i, 1, load(wrench, i, 1) - (ty + ez * fx - ex * fz))
        store(wrench, i, 2, load(wrench, i, 2) - (tz + ex * fy - ey * fx))
        store(wrench, i, 3, load(wrench, i, 3) - fx)
        store(wrench, i, 4, load(wrench, i, 4) - fy)
        store(wrench, i, 5, load(wrench, i, 5) - fz)
        sx, sy, sz = q0 * fx + q3 * fy + q6 * fz, q1 * fx + q4 * fy + q7 * fz, q2 * fx + q5 * fy + q8 * fz
        store(wrench, j, 0, load(wrench, j, 0) + q0 * tx + q3 * ty + q6 * tz + by * sz - bz * sy)
        store(wrench, j, 1, load(wrench, j, 1) + q1 * tx + q4 * ty + q7 * tz + bz * sx - bx * sz)
        store(wrench, j, 2, load(wrench, j, 2) + q2 * tx + q5 * ty + q8 * tz + bx * sy - by * sx)
        store(wrench, j, 3, load(wrench, j, 3) + sx)
        store(wrench, j, 4, load(wrench, j, 4) + sy)
        store(wrench, j, 5, load(wrench, j, 5) + sz)


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
