"""Strip aerodynamics (thesis III-E, Eqs. 8-13), lane by lane.

A strip has one airflow and one angle of attack, from the area-weighted motion of its bodies; its lift and drag are
shared among them. Beyond what is printed: alpha lies in [-pi/2, pi/2], drag grows with |alpha| (as printed it would
push the wing at negative angles), and in reversed flow the lift keeps the sign of the normal flow; the change of sign
is smoothed over ``REVERSAL`` (about 3 degrees around 90) so that the force has no jump.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim.kernels import LANES
from sim.kernels.jit import kernel

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
REVERSAL = 0.05
STILL = 1e-9  # m/s, keeps the angle of attack defined without flow


@kernel
def strip_forces(
    start: Index,
    weight: Array,
    centroid: Array,
    area: Array,
    density: float,
    wind: Array,
    coefficients: Array,
    lift_share: Array,
    lift_x: Array,
    drag_share: Array,
    drag_x: Array,
    R: Array,
    V: Array,
    wrench: Array,
    damping: Array,
    power: Array,
    force: Array,
) -> None:
    """Add the air's wrench to every body.

    ``start`` [S + 1]: bodies of each strip; ``weight`` [N]: share of the strip's area, ``centroid`` [N, 2]: planform
    centroid in the body frame; ``coefficients`` [4, W]: L_a, L_b, ID_a, ID_b. ``lift_x``, ``drag_x`` [N, W]: where the
    shares act along the chord, in the body frame. Also out: ``damping`` [N, W], force per normal speed of the body (for
    the linearisation), ``power`` [W] of the air on the wing, ``force`` [3, W] of the air on the wing in the world.
    """
    flow = np.empty((9, LANES))
    lift, drag = np.empty((4, LANES)), np.empty((4, LANES))
    for s in range(len(area)):
        flow[:] = 0.0
        for n in range(start[s], start[s + 1]):
            g, x, y = weight[n], centroid[n, 0], centroid[n, 1]
            for w in range(LANES):
                oz = V[n, 2, w]
                vx, vy = V[n, 3, w] - oz * y, V[n, 4, w] + oz * x
                vz = V[n, 5, w] + V[n, 0, w] * y - V[n, 1, w] * x
                for i in range(3):
                    flow[i, w] += g * (R[n, 3 * i, w] * vx + R[n, 3 * i + 1, w] * vy + R[n, 3 * i + 2, w] * vz)
                    flow[3 + i, w] += g * R[n, 3 * i, w]
                    flow[6 + i, w] += g * R[n, 3 * i + 2, w]
        scale = 0.5 * density * area[s]
        for w in range(LANES):
            cx, cy, cz = flow[3, w], flow[4, w], flow[5, w]
            r = 1.0 / math.sqrt(cx * cx + cy * cy + cz * cz)
            cx, cy, cz = cx * r, cy * r, cz * r
            nx, ny, nz = flow[6, w], flow[7, w], flow[8, w]
            r = nx * cx + ny * cy + nz * cz
            nx, ny, nz = nx - r * cx, ny - r * cy, nz - r * cz
            r = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx * r, ny * r, nz * r
            ux, uy, uz = wind[0] - flow[0, w], wind[1] - flow[1, w], wind[2] - flow[2, w]
            uc = ux * cx + uy * cy + uz * cz
            un = ux * nx + uy * ny + uz * nz
            q = math.sqrt(uc * uc + un * un + STILL * STILL)
            forward = uc / math.sqrt(uc * uc + REVERSAL * REVERSAL * q * q)
            alpha = math.atan2(un, uc * forward)
            cl = coefficients[0, w] * alpha + coefficients[1, w]
            cd = coefficients[2, w] * abs(alpha) + coefficients[3, w]
            fl = scale * q * cl * forward
            fd = scale * q * cd
            lift[0, w] = fl * (uc * nx - un * cx)
            lift[1, w] = fl * (uc * ny - un * cy)
            lift[2, w] = fl * (uc * nz - un * cz)
            lift[3, w] = scale * q * coefficients[0, w]
            drag[0, w] = fd * (uc * cx + un * nx)
            drag[1, w] = fd * (uc * cy + un * ny)
            drag[2, w] = fd * (uc * cz + un * nz)
            drag[3, w] = scale * q * (cd + coefficients[2, w])
            for i in range(3):
                force[i, w] += lift[i, w] + drag[i, w]
        for n in range(start[s], start[s + 1]):
            y = centroid[n, 1]
            for w in range(LANES):
                a, b = lift_share[n, w], drag_share[n, w]
                lx = a * (R[n, 0, w] * lift[0, w] + R[n, 3, w] * lift[1, w] + R[n, 6, w] * lift[2, w])
                ly = a * (R[n, 1, w] * lift[0, w] + R[n, 4, w] * lift[1, w] + R[n, 7, w] * lift[2, w])
                lz = a * (R[n, 2, w] * lift[0, w] + R[n, 5, w] * lift[1, w] + R[n, 8, w] * lift[2, w])
                dx = b * (R[n, 0, w] * drag[0, w] + R[n, 3, w] * drag[1, w] + R[n, 6, w] * drag[2, w])
                dy = b * (R[n, 1, w] * drag[0, w] + R[n, 4, w] * drag[1, w] + R[n, 7, w] * drag[2, w])
                dz = b * (R[n, 2, w] * drag[0, w] + R[n, 5, w] * drag[1, w] + R[n, 8, w] * drag[2, w])
                tx, ty = y * (lz + dz), -lift_x[n, w] * lz - drag_x[n, w] * dz
                tz = lift_x[n, w] * ly + drag_x[n, w] * dy - y * (lx + dx)
                wrench[n, 0, w] += tx
                wrench[n, 1, w] += ty
                wrench[n, 2, w] += tz
                wrench[n, 3, w] += lx + dx
                wrench[n, 4, w] += ly + dy
                wrench[n, 5, w] += lz + dz
                damping[n, w] = a * lift[3, w] + b * drag[3, w]
                power[w] += tx * V[n, 0, w] + ty * V[n, 1, w] + tz * V[n, 2, w]
                power[w] += (lx + dx) * V[n, 3, w] + (ly + dy) * V[n, 4, w] + (lz + dz) * V[n, 5, w]
