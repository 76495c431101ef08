"""Strip aerodynamics (van der Grinten's thesis III-E, Eqs. 8-13), for W individuals at a time.

Each strip of the wing, a slice across the span made of one or more bodies, has one airflow and one angle of attack
alpha, from the area-weighted motion of its bodies; its lift and drag are distributed to these bodies. Differences from
the printed equations: alpha lies in [-pi/2, pi/2]; drag grows with |alpha| (as printed, it would accelerate the wing at
negative angles); in reversed flow the lift has the sign of the normal flow, with the change of sign smoothed within 15
degrees of 90 so that the force is continuous. The affine laws of C_L and C_D are valid to about 15 degrees and are
used as printed beyond.
"""

from __future__ import annotations

import math

import numpy as np

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels import LANES, arrays
from wingfit.sim.kernels.jit import allocating, inlined, kernel
from wingfit.sim.kernels.lanes.lanewise import angle
from wingfit.sim.kernels.lanes.matrices import Three, add_wrench, load_matrix, times, transposed
from wingfit.sim.kernels.lanes.vector import greatest, least, load, load0, load1, magnitude, root, store, store0, store1

REVERSAL = math.sin(math.radians(15.0))
STILL = 1e-9  # m/s, avoids division by zero without flow


@allocating
def strip_flow(
    start: Index, weight: Array, centroid: Array, wind: Array, coefficients: Array, induced: Array, R: Array,
    p: Array, V: Array, flow: Array, loads: Array,
) -> None:  # fmt: skip
    """Set the airflow ``flow`` [S, FLOW, W] of every strip, and its ``loads`` [S, LOADS, W] by the affine laws.

    S strips, W individuals, N bodies; the columns of ``flow`` and ``loads`` are listed in
    :mod:`wingfit.sim.kernels.arrays`. Strip s consists of the bodies ``start[s]`` to ``start[s + 1]`` - 1. ``weight``
    [N]: each body's fraction of the strip's area; ``centroid`` [N, 2]: x and y of the centroid of its planform, body
    frame (m); ``coefficients`` [4, W]: L_a, L_b, ID_a, ID_b of C_L = L_a alpha + L_b and C_D = ID_a |alpha| + ID_b.
    ``wind`` [3, W] and ``induced`` [S, 3, W]: velocity of the stream and of the air in addition to it (m/s, world
    axes); if ``induced`` is empty, position and pitch rate of the strips are not computed either. R, p, V: poses and
    twists of the bodies (:mod:`wingfit.sim.kernels.bodies`).
    """
    mean = np.empty((9, LANES))
    for s in range(len(start) - 1):
        mean[:] = 0.0
        for n in range(start[s], start[s + 1]):
            g, x, y = weight[n], centroid[n, 0], centroid[n, 1]
            oz = load(V, n, 2)
            vx, vy = load(V, n, 3) - oz * y, load(V, n, 4) + oz * x
            vz = load(V, n, 5) + load(V, n, 0) * y - load(V, n, 1) * x
            for i in range(3):
                world = load(R, n, 3 * i) * vx + load(R, n, 3 * i + 1) * vy + load(R, n, 3 * i + 2) * vz
                store1(mean, i, load1(mean, i) + g * world)
                store1(mean, 3 + i, load1(mean, 3 + i) + g * load(R, n, 3 * i))
                store1(mean, 6 + i, load1(mean, 6 + i) + g * load(R, n, 3 * i + 2))
        cx, cy, cz = load1(mean, 3), load1(mean, 4), load1(mean, 5)
        r = 1.0 / root(cx * cx + cy * cy + cz * cz)
        cx, cy, cz = cx * r, cy * r, cz * r
        nx, ny, nz = load1(mean, 6), load1(mean, 7), load1(mean, 8)
        r = nx * cx + ny * cy + nz * cz
        nx, ny, nz = nx - r * cx, ny - r * cy, nz - r * cz
        r = 1.0 / root(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * r, ny * r, nz * r
        ux, uy, uz = load1(wind, 0) - load1(mean, 0), load1(wind, 1) - load1(mean, 1), load1(wind, 2) - load1(mean, 2)
        if len(induced):
            ux, uy, uz = ux + load(induced, s, 0), uy + load(induced, s, 1), uz + load(induced, s, 2)
            _position_and_pitch_rate(s, start, weight, centroid, R, p, V, flow)
        uc = ux * cx + uy * cy + uz * cz
        un = ux * nx + uy * ny + uz * nz
        q = root(uc * uc + un * un + STILL * STILL)
        x = least(greatest(uc / (REVERSAL * q), -1.0), 1.0)
        forward = 0.5 * x * (3.0 - x * x)
        alpha = angle(un, uc * forward)
        for i, value in enumerate((cx, cy, cz)):
            store(flow, s, arrays.CHORD_X + i, value)
        for i, value in enumerate((nx, ny, nz)):
            store(flow, s, arrays.NORMAL_X + i, value)
        store(flow, s, arrays.STREAM_C, uc)
        store(flow, s, arrays.STREAM_N, un)
        store(flow, s, arrays.SPEED, q)
        store(flow, s, arrays.ALPHA, alpha)
        store(flow, s, arrays.FORWARD, forward)
        cl = load1(coefficients, 0) * alpha + load1(coefficients, 1)
        cd = load1(coefficients, 2) * magnitude(alpha) + load1(coefficients, 3)
        store(loads, s, arrays.CIRCULATION, q * cl * forward)
        store(loads, s, arrays.DRAG, q * cd)
        store(loads, s, arrays.LIFT_SLOPE, q * load1(coefficients, 0))
        store(loads, s, arrays.DRAG_SLOPE, q * (cd + load1(coefficients, 2)))
        for i in (arrays.PUSH_N, arrays.PUSH_C, arrays.PUSH_M, arrays.PUSH_L):
            store(loads, s, i, 0.0)


@kernel
def _position_and_pitch_rate(
    s: int, start: Index, weight: Array, centroid: Array, R: Array, p: Array, V: Array, flow: Array
) -> None:
    """Set in ``flow`` the centroid of strip ``s`` (m, world) and its mean pitch rate (rad/s, nose up)."""
    for i in (arrays.PLACE_X, arrays.PLACE_X + 1, arrays.PLACE_X + 2, arrays.PITCH_RATE):
        store(flow, s, i, 0.0)
    for n in range(start[s], start[s + 1]):
        g, x, y = weight[n], centroid[n, 0], centroid[n, 1]
        for i in range(3):
            place = load(p, n, i) + load(R, n, 3 * i) * x + load(R, n, 3 * i + 1) * y
            store(flow, s, arrays.PLACE_X + i, load(flow, s, arrays.PLACE_X + i) + g * place)
        store(flow, s, arrays.PITCH_RATE, load(flow, s, arrays.PITCH_RATE) + g * load(V, n, 1))


@inlined
def _vector(array: Array) -> Three:
    """Load rows 0, 1 and 2 of ``array`` [., W] as a 3-vector of lanes."""
    return load1(array, 0), load1(array, 1), load1(array, 2)


@allocating
def strip_forces(
    start: Index, weight: Array, centroid: Array, geometry: Array, density: Array, lift_share: Array, lift_x: Array,
    drag_share: Array, drag_x: Array, flow: Array, loads: Array, spread: bool, R: Array, V: Array, wrench: Array,
    damping: Array, power: Array, force: Array,
) -> None:  # fmt: skip
    """Add to ``wrench`` [N+2, 6, W] the moment and force of the air on every body, from the ``loads`` of its strip.

    S strips, N bodies, W individuals. ``geometry`` [S, GEOMETRY] of the strips; ``density`` [W] of the air, kg/m^3;
    ``lift_share``, ``drag_share`` [N, W]: the body's fraction of the strip's lift and drag; ``lift_x``, ``drag_x`` [N,
    W]: where these act along the chord, body frame (m); ``spread``: whether the columns PUSH_* of ``loads``, uniform
    over the strip, are nonzero; other inputs as in :func:`strip_flow`. Outputs: ``damping`` [N, W] is set to the force
    per normal speed of each body (N s/m, for the linearisation); the power of the air on the wing is added to ``power``
    [W] (W), and its force in world axes to ``force`` [3, W] (N).
    """
    lift, drag = np.empty((4, LANES)), np.empty((4, LANES))
    push = np.empty((5, LANES))
    for s in range(len(start) - 1):
        scale = load0(density) * (0.5 * geometry[s, arrays.AREA])
        uc, un = load(flow, s, arrays.STREAM_C), load(flow, s, arrays.STREAM_N)
        fl, fd = scale * load(loads, s, arrays.CIRCULATION), scale * load(loads, s, arrays.DRAG)
        for i in range(3):
            c, n_ = load(flow, s, arrays.CHORD_X + i), load(flow, s, arrays.NORMAL_X + i)
            store1(lift, i, fl * (uc * n_ - un * c))
            store1(drag, i, fd * (uc * c + un * n_))
            store1(force, i, load1(force, i) + load1(lift, i) + load1(drag, i))
            if spread:
                store1(push, i, scale * (load(loads, s, arrays.PUSH_C) * c + load(loads, s, arrays.PUSH_N) * n_))
                store1(force, i, load1(force, i) + load1(push, i))
        store1(lift, 3, scale * load(loads, s, arrays.LIFT_SLOPE))
        store1(drag, 3, scale * load(loads, s, arrays.DRAG_SLOPE))
        if spread:
            store1(push, 3, scale * load(loads, s, arrays.PUSH_M))
            store1(push, 4, scale * load(loads, s, arrays.PUSH_L))
        for n in range(start[s], start[s + 1]):
            y = centroid[n, 1]
            a, b = load1(lift_share, n), load1(drag_share, n)
            back = transposed(load_matrix(R, n))
            up, away = times(back, _vector(lift)), times(back, _vector(drag))
            lx, ly, lz, dx, dy, dz = a * up[0], a * up[1], a * up[2], b * away[0], b * away[1], b * away[2]
            tx, ty = y * (lz + dz), -load1(lift_x, n) * lz - load1(drag_x, n) * dz
            tz = load1(lift_x, n) * ly + load1(drag_x, n) * dy - y * (lx + dx)
            fx, fy, fz = lx + dx, ly + dy, lz + dz
            if spread:
                g, x = weight[n], centroid[n, 0]
                px, py, pz = times(back, _vector(push))
                tx, ty = tx + (g * y) * pz + g * load1(push, 4), ty - (g * x) * pz + g * load1(push, 3)
                tz = tz + g * (x * py - y * px)
                fx, fy, fz = fx + g * px, fy + g * py, fz + g * pz
            add_wrench(wrench, n, (tx, ty, tz), (fx, fy, fz))
            store1(damping, n, a * load1(lift, 3) + b * load1(drag, 3))
            turning = tx * load(V, n, 0) + ty * load(V, n, 1) + tz * load(V, n, 2)
            moving = fx * load(V, n, 3) + fy * load(V, n, 4) + fz * load(V, n, 5)
            store0(power, load0(power) + turning + moving)
