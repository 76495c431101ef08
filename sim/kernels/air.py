"""Strip aerodynamics (thesis III-E, Eqs. 8-13), lane by lane.

A strip has one airflow and one angle of attack, from the area-weighted motion of its bodies; its lift and drag are
shared among them. Beyond what is printed: alpha lies in [-pi/2, pi/2], drag grows with |alpha| (as printed it would
push the wing at negative angles), and in reversed flow the lift keeps the sign of the normal flow; the change of sign
is smoothed within 15 degrees of 90 so that the force has no jump, and is exactly one elsewhere. The affine law is good
to about 15 degrees and is used as printed beyond.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim.kernels import LANES
from sim.kernels.jit import kernel
from sim.kernels.vector import Vector, greatest, least, load, load0, load1, magnitude, root, store, store0, store1

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
REVERSAL = math.sin(math.radians(15.0))
STILL = 1e-9  # m/s, keeps the angle of attack defined without flow


@kernel
def angle(y: Vector, x: Vector) -> Vector:
    """atan2 lane by lane: there is no vector instruction for it."""
    scratch = np.empty((2, LANES))
    store1(scratch, 0, y)
    store1(scratch, 1, x)
    for w in range(LANES):
        scratch[0, w] = math.atan2(scratch[0, w], scratch[1, w])
    return load1(scratch, 0)


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
            oz = load(V, n, 2)
            vx, vy = load(V, n, 3) - oz * y, load(V, n, 4) + oz * x
            vz = load(V, n, 5) + load(V, n, 0) * y - load(V, n, 1) * x
            for i in range(3):
                world = load(R, n, 3 * i) * vx + load(R, n, 3 * i + 1) * vy + load(R, n, 3 * i + 2) * vz
                store1(flow, i, load1(flow, i) + g * world)
                store1(flow, 3 + i, load1(flow, 3 + i) + g * load(R, n, 3 * i))
                store1(flow, 6 + i, load1(flow, 6 + i) + g * load(R, n, 3 * i + 2))
        scale = 0.5 * density * area[s]
        cx, cy, cz = load1(flow, 3), load1(flow, 4), load1(flow, 5)
        r = 1.0 / root(cx * cx + cy * cy + cz * cz)
        cx, cy, cz = cx * r, cy * r, cz * r
        nx, ny, nz = load1(flow, 6), load1(flow, 7), load1(flow, 8)
        r = nx * cx + ny * cy + nz * cz
        nx, ny, nz = nx - r * cx, ny - r * cy, nz - r * cz
        r = 1.0 / root(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * r, ny * r, nz * r
        ux, uy, uz = wind[0] - load1(flow, 0), wind[1] - load1(flow, 1), wind[2] - load1(flow, 2)
        uc = ux * cx + uy * cy + uz * cz
        un = ux * nx + uy * ny + uz * nz
        q = root(uc * uc + un * un + STILL * STILL)
        x = least(greatest(uc / (REVERSAL * q), -1.0), 1.0)
        forward = 0.5 * x * (3.0 - x * x)
        alpha = angle(un, uc * forward)
        cl = load1(coefficients, 0) * alpha + load1(coefficients, 1)
        cd = load1(coefficients, 2) * magnitude(alpha) + load1(coefficients, 3)
        fl = scale * q * cl * forward
        fd = scale * q * cd
        store1(lift, 0, fl * (uc * nx - un * cx))
        store1(lift, 1, fl * (uc * ny - un * cy))
        store1(lift, 2, fl * (uc * nz - un * cz))
        store1(lift, 3, scale * q * load1(coefficients, 0))
        store1(drag, 0, fd * (uc * cx + un * nx))
        store1(drag, 1, fd * (uc * cy + un * ny))
        store1(drag, 2, fd * (uc * cz + un * nz))
        store1(drag, 3, scale * q * (cd + load1(coefficients, 2)))
        for i in range(3):
            store1(force, i, load1(force, i) + load1(lift, i) + load1(drag, i))
        for n in range(start[s], start[s + 1]):
            y = centroid[n, 1]
            a, b = load1(lift_share, n), load1(drag_share, n)
            lx = a * (load(R, n, 0) * load1(lift, 0) + load(R, n, 3) * load1(lift, 1) + load(R, n, 6) * load1(lift, 2))
            ly = a * (load(R, n, 1) * load1(lift, 0) + load(R, n, 4) * load1(lift, 1) + load(R, n, 7) * load1(lift, 2))
            lz = a * (load(R, n, 2) * load1(lift, 0) + load(R, n, 5) * load1(lift, 1) + load(R, n, 8) * load1(lift, 2))
            dx = b * (load(R, n, 0) * load1(drag, 0) + load(R, n, 3) * load1(drag, 1) + load(R, n, 6) * load1(drag, 2))
            dy = b * (load(R, n, 1) * load1(drag, 0) + load(R, n, 4) * load1(drag, 1) + load(R, n, 7) * load1(drag, 2))
            dz = b * (load(R, n, 2) * load1(drag, 0) + load(R, n, 5) * load1(drag, 1) + load(R, n, 8) * load1(drag, 2))
            tx, ty = y * (lz + dz), -load1(lift_x, n) * lz - load1(drag_x, n) * dz
            tz = load1(lift_x, n) * ly + load1(drag_x, n) * dy - y * (lx + dx)
            store(wrench, n, 0, load(wrench, n, 0) + tx)
            store(wrench, n, 1, load(wrench, n, 1) + ty)
            store(wrench, n, 2, load(wrench, n, 2) + tz)
            store(wrench, n, 3, load(wrench, n, 3) + lx + dx)
            store(wrench, n, 4, load(wrench, n, 4) + ly + dy)
            store(wrench, n, 5, load(wrench, n, 5) + lz + dz)
            store1(damping, n, a * load1(lift, 3) + b * load1(drag, 3))
            turning = tx * load(V, n, 0) + ty * load(V, n, 1) + tz * load(V, n, 2)
            moving = (lx + dx) * load(V, n, 3) + (ly + dy) * load(V, n, 4) + (lz + dz) * load(V, n, 5)
            store0(power, load0(power) + turning + moving)
