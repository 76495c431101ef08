"""The 6-D springs and dampers between bodies (thesis Eqs. 4-7), lane by lane.

A connector joins frame A on body ``first`` (at arm a) to frame B on body ``second`` (at arm b), both aligned with
their bodies. Q = R_A^T R_B and d = R_A^T (o_B - o_A) are B's pose in A. Energies (physics of the spring):
V_o = -tr(G_o Q) + tr(G_o), V_t = 1/4 d^T K_t d + 1/4 d^T Q K_t Q^T d. The wrench on B, in A's axes at o_B, is minus
their gradient; that on A balances it: force and moment vanish in sum, the forces being d apart.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim.kernels import LANES
from sim.kernels.jit import kernel

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@kernel
def relative_pose(first: Index, second: Index, a: Array, b: Array, R: Array, p: Array, Q: Array, d: Array) -> None:
    """Q [C, 9, W] and d [C, 3, W] of every connector."""
    for c in range(len(first)):
        i, j = first[c], second[c]
        ax, ay, az = a[c, 0], a[c, 1], a[c, 2]
        bx, by, bz = b[c, 0], b[c, 1], b[c, 2]
        for w in range(LANES):
            i0, i1, i2 = R[i, 0, w], R[i, 1, w], R[i, 2, w]
            i3, i4, i5 = R[i, 3, w], R[i, 4, w], R[i, 5, w]
            i6, i7, i8 = R[i, 6, w], R[i, 7, w], R[i, 8, w]
            j0, j1, j2 = R[j, 0, w], R[j, 1, w], R[j, 2, w]
            j3, j4, j5 = R[j, 3, w], R[j, 4, w], R[j, 5, w]
            j6, j7, j8 = R[j, 6, w], R[j, 7, w], R[j, 8, w]
            x = p[j, 0, w] - p[i, 0, w] + j0 * bx + j1 * by + j2 * bz
            y = p[j, 1, w] - p[i, 1, w] + j3 * bx + j4 * by + j5 * bz
            z = p[j, 2, w] - p[i, 2, w] + j6 * bx + j7 * by + j8 * bz
            d[c, 0, w] = i0 * x + i3 * y + i6 * z - ax
            d[c, 1, w] = i1 * x + i4 * y + i7 * z - ay
            d[c, 2, w] = i2 * x + i5 * y + i8 * z - az
            Q[c, 0, w] = i0 * j0 + i3 * j3 + i6 * j6
            Q[c, 1, w] = i0 * j1 + i3 * j4 + i6 * j7
            Q[c, 2, w] = i0 * j2 + i3 * j5 + i6 * j8
            Q[c, 3, w] = i1 * j0 + i4 * j3 + i7 * j6
            Q[c, 4, w] = i1 * j1 + i4 * j4 + i7 * j7
            Q[c, 5, w] = i1 * j2 + i4 * j5 + i7 * j8
            Q[c, 6, w] = i2 * j0 + i5 * j3 + i8 * j6
            Q[c, 7, w] = i2 * j1 + i5 * j4 + i8 * j7
            Q[c, 8, w] = i2 * j2 + i5 * j5 + i8 * j8


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
        for w in range(LANES):
            q0, q1, q2 = Q[c, 0, w], Q[c, 1, w], Q[c, 2, w]
            q3, q4, q5 = Q[c, 3, w], Q[c, 4, w], Q[c, 5, w]
            q6, q7, q8 = Q[c, 6, w], Q[c, 7, w], Q[c, 8, w]
            x, y, z = d[c, 0, w], d[c, 1, w], d[c, 2, w]
            ex, ey, ez = ax + x, ay + y, az + z
            # co-stiffness G = tr(K)/2 - K (Eq. 5)
            kx, ky, kz = K[c, 0, w], K[c, 1, w], K[c, 2, w]
            gx, gy, gz = 0.5 * (ky + kz - kx), 0.5 * (kz + kx - ky), 0.5 * (kx + ky - kz)
            tx, ty, tz = q5 * gz - q7 * gy, q6 * gx - q2 * gz, q1 * gy - q3 * gx
            energy = gx * (1.0 - q0) + gy * (1.0 - q4) + gz * (1.0 - q8)
            # S d = Q K_t Q^T d
            kx, ky, kz = K[c, 3, w], K[c, 4, w], K[c, 5, w]
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
            ox, oy, oz = V[i, 0, w], V[i, 1, w], V[i, 2, w]
            wx, wy, wz = V[j, 0, w], V[j, 1, w], V[j, 2, w]
            vx = V[j, 3, w] + wy * bz - wz * by
            vy = V[j, 4, w] + wz * bx - wx * bz
            vz = V[j, 5, w] + wx * by - wy * bx
            rx = q0 * wx + q1 * wy + q2 * wz - ox
            ry = q3 * wx + q4 * wy + q5 * wz - oy
            rz = q6 * wx + q7 * wy + q8 * wz - oz
            ux = q0 * vx + q1 * vy + q2 * vz - V[i, 3, w] - (oy * ez - oz * ey)
            uy = q3 * vx + q4 * vy + q5 * vz - V[i, 4, w] - (oz * ex - ox * ez)
            uz = q6 * vx + q7 * vy + q8 * vz - V[i, 5, w] - (ox * ey - oy * ex)
            sx, sy, sz = D[c, 0, w] * rx, D[c, 1, w] * ry, D[c, 2, w] * rz
            loss = sx * rx + sy * ry + sz * rz
            tx, ty, tz = tx - sx, ty - sy, tz - sz
            sx, sy, sz = D[c, 3, w] * ux, D[c, 4, w] * uy, D[c, 5, w] * uz
            loss += sx * ux + sy * uy + sz * uz
            fx, fy, fz = fx - sx, fy - sy, fz - sz
            dissipated[w] += loss
            stored[w] += energy
            wrench[i, 0, w] -= tx + ey * fz - ez * fy
            wrench[i, 1, w] -= ty + ez * fx - ex * fz
            wrench[i, 2, w] -= tz + ex * fy - ey * fx
            wrench[i, 3, w] -= fx
            wrench[i, 4, w] -= fy
            wrench[i, 5, w] -= fz
            sx, sy, sz = q0 * fx + q3 * fy + q6 * fz, q1 * fx + q4 * fy + q7 * fz, q2 * fx + q5 * fy + q8 * fz
            wrench[j, 0, w] += q0 * tx + q3 * ty + q6 * tz + by * sz - bz * sy
            wrench[j, 1, w] += q1 * tx + q4 * ty + q7 * tz + bz * sx - bx * sz
            wrench[j, 2, w] += q2 * tx + q5 * ty + q8 * tz + bx * sy - by * sx
            wrench[j, 3, w] += sx
            wrench[j, 4, w] += sy
            wrench[j, 5, w] += sz


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
        for w in range(LANES):
            q0, q1, q2 = Q[c, 0, w], Q[c, 1, w], Q[c, 2, w]
            q3, q4, q5 = Q[c, 3, w], Q[c, 4, w], Q[c, 5, w]
            q6, q7, q8 = Q[c, 6, w], Q[c, 7, w], Q[c, 8, w]
            ex, ey, ez = ax + d[c, 0, w], ay + d[c, 1, w], az + d[c, 2, w]
            ox, oy, oz = X[i, 0, w], X[i, 1, w], X[i, 2, w]
            wx, wy, wz = X[j, 0, w], X[j, 1, w], X[j, 2, w]
            vx = X[j, 3, w] + wy * bz - wz * by
            vy = X[j, 4, w] + wz * bx - wx * bz
            vz = X[j, 5, w] + wx * by - wy * bx
            tx = C[c, 0, w] * (q0 * wx + q1 * wy + q2 * wz - ox)
            ty = C[c, 1, w] * (q3 * wx + q4 * wy + q5 * wz - oy)
            tz = C[c, 2, w] * (q6 * wx + q7 * wy + q8 * wz - oz)
            fx = C[c, 3, w] * (q0 * vx + q1 * vy + q2 * vz - X[i, 3, w] - (oy * ez - oz * ey))
            fy = C[c, 4, w] * (q3 * vx + q4 * vy + q5 * vz - X[i, 4, w] - (oz * ex - ox * ez))
            fz = C[c, 5, w] * (q6 * vx + q7 * vy + q8 * vz - X[i, 5, w] - (ox * ey - oy * ex))
            out[i, 0, w] += tx + ey * fz - ez * fy
            out[i, 1, w] += ty + ez * fx - ex * fz
            out[i, 2, w] += tz + ex * fy - ey * fx
            out[i, 3, w] += fx
            out[i, 4, w] += fy
            out[i, 5, w] += fz
            sx, sy, sz = q0 * fx + q3 * fy + q6 * fz, q1 * fx + q4 * fy + q7 * fz, q2 * fx + q5 * fy + q8 * fz
            out[j, 0, w] -= q0 * tx + q3 * ty + q6 * tz + by * sz - bz * sy
            out[j, 1, w] -= q1 * tx + q4 * ty + q7 * tz + bz * sx - bx * sz
            out[j, 2, w] -= q2 * tx + q5 * ty + q8 * tz + bx * sy - by * sx
            out[j, 3, w] -= sx
            out[j, 4, w] -= sy
            out[j, 5, w] -= sz
