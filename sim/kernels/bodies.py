"""Poses and inertia of rigid bodies, lane by lane.

Layout: R [N, 9, W] row-major rotation body -> world, p [N, 3, W] centre of mass in the world, V [N, 6, W] twist
(omega, v) in the body frame, xi [N, 6, W] local coordinates (theta, d) about the pose at the start of the step:
R = R0 exp(theta~), p = p0 + R0 d. Wrenches [N, 6, W] are (tau, F) in the body frame at the centre of mass.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim.kernels import LANES
from sim.kernels.jit import kernel

Array = npt.NDArray[np.float64]


@kernel
def move(R0: Array, p0: Array, xi: Array, R: Array, p: Array) -> None:
    """Pose at local coordinates ``xi`` about (R0, p0).

    sin(t)/t and (1 - cos(t))/t^2 are summed as series in t^2 (exact to round-off for t < 1; larger rotations in one
    step are a diverging individual, which the integrator flags).
    """
    for n in range(len(xi)):
        for w in range(LANES):
            x, y, z = xi[n, 0, w], xi[n, 1, w], xi[n, 2, w]
            t2 = x * x + y * y + z * z
            s = 1.0 - t2 * (1.0 / 156.0) * (1.0 - t2 * (1.0 / 210.0))
            s = 1.0 - t2 * (1.0 / 42.0) * (1.0 - t2 * (1.0 / 72.0) * (1.0 - t2 * (1.0 / 110.0) * s))
            s = 1.0 - t2 * (1.0 / 6.0) * (1.0 - t2 * (1.0 / 20.0) * s)
            c = 1.0 - t2 * (1.0 / 182.0) * (1.0 - t2 * (1.0 / 240.0))
            c = 1.0 - t2 * (1.0 / 56.0) * (1.0 - t2 * (1.0 / 90.0) * (1.0 - t2 * (1.0 / 132.0) * c))
            c = 0.5 * (1.0 - t2 * (1.0 / 12.0) * (1.0 - t2 * (1.0 / 30.0) * c))
            e00, e01, e02 = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
            e10, e11, e12 = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
            e20, e21, e22 = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)
            dx, dy, dz = xi[n, 3, w], xi[n, 4, w], xi[n, 5, w]
            for i in range(3):
                r0, r1, r2 = R0[n, 3 * i, w], R0[n, 3 * i + 1, w], R0[n, 3 * i + 2, w]
                R[n, 3 * i, w] = r0 * e00 + r1 * e10 + r2 * e20
                R[n, 3 * i + 1, w] = r0 * e01 + r1 * e11 + r2 * e21
                R[n, 3 * i + 2, w] = r0 * e02 + r1 * e12 + r2 * e22
                p[n, i, w] = p0[n, i, w] + r0 * dx + r1 * dy + r2 * dz


@kernel
def local_rate(xi: Array, V: Array, rate: Array) -> None:
    """Rate of the local coordinates: theta' = omega + theta x omega / 2 + theta x (theta x omega) / 12, d' = exp v.

    theta is O(step); the series are cut where the rest is of fourth order in it.
    """
    for n in range(len(V)):
        for w in range(LANES):
            x, y, z = xi[n, 0, w], xi[n, 1, w], xi[n, 2, w]
            a, b, c = V[n, 0, w], V[n, 1, w], V[n, 2, w]
            u, v, q = y * c - z * b, z * a - x * c, x * b - y * a
            rate[n, 0, w] = a + 0.5 * u + (y * q - z * v) * (1.0 / 12.0)
            rate[n, 1, w] = b + 0.5 * v + (z * u - x * q) * (1.0 / 12.0)
            rate[n, 2, w] = c + 0.5 * q + (x * v - y * u) * (1.0 / 12.0)
            a, b, c = V[n, 3, w], V[n, 4, w], V[n, 5, w]
            u, v, q = y * c - z * b, z * a - x * c, x * b - y * a
            g, h, k = y * q - z * v, z * u - x * q, x * v - y * u
            rate[n, 3, w] = a + u + 0.5 * g + (y * k - z * h) * (1.0 / 6.0)
            rate[n, 4, w] = b + v + 0.5 * h + (z * g - x * k) * (1.0 / 6.0)
            rate[n, 5, w] = c + q + 0.5 * k + (x * h - y * g) * (1.0 / 6.0)


@kernel
def inertial(mass: Array, inertia: Array, R: Array, V: Array, gravity: float, wrench: Array) -> None:
    """Start the wrench on each body: gravity and the gyroscopic terms -omega x (I omega), -m omega x v."""
    for n in range(len(mass)):
        m = mass[n]
        i00, i11, i22 = inertia[n, 0], inertia[n, 4], inertia[n, 8]
        i01, i02, i12 = inertia[n, 1], inertia[n, 2], inertia[n, 5]
        for w in range(LANES):
            a, b, c = V[n, 0, w], V[n, 1, w], V[n, 2, w]
            x, y, z = V[n, 3, w], V[n, 4, w], V[n, 5, w]
            hx, hy, hz = i00 * a + i01 * b + i02 * c, i01 * a + i11 * b + i12 * c, i02 * a + i12 * b + i22 * c
            wrench[n, 0, w] = hy * c - hz * b
            wrench[n, 1, w] = hz * a - hx * c
            wrench[n, 2, w] = hx * b - hy * a
            wrench[n, 3, w] = -m * (b * z - c * y + gravity * R[n, 6, w])
            wrench[n, 4, w] = -m * (c * x - a * z + gravity * R[n, 7, w])
            wrench[n, 5, w] = -m * (a * y - b * x + gravity * R[n, 8, w])


@kernel
def times_mass(mass: Array, inertia: Array, V: Array, out: Array) -> None:
    """Add M V to ``out``: momentum of each body in its own frame."""
    for n in range(len(mass)):
        m = mass[n]
        i00, i11, i22 = inertia[n, 0], inertia[n, 4], inertia[n, 8]
        i01, i02, i12 = inertia[n, 1], inertia[n, 2], inertia[n, 5]
        for w in range(LANES):
            a, b, c = V[n, 0, w], V[n, 1, w], V[n, 2, w]
            out[n, 0, w] += i00 * a + i01 * b + i02 * c
            out[n, 1, w] += i01 * a + i11 * b + i12 * c
            out[n, 2, w] += i02 * a + i12 * b + i22 * c
            out[n, 3, w] += m * V[n, 3, w]
            out[n, 4, w] += m * V[n, 4, w]
            out[n, 5, w] += m * V[n, 5, w]


@kernel
def kinetic_and_height(
    mass: Array, inertia: Array, p: Array, V: Array, gravity: float, kinetic: Array, potential: Array
) -> None:
    """Kinetic energy 1/2 V^T M V and potential energy m g z of all bodies, per lane."""
    kinetic[:] = 0.0
    potential[:] = 0.0
    momentum = np.zeros_like(V)
    times_mass(mass, inertia, V, momentum)
    for n in range(len(mass)):
        for w in range(LANES):
            for k in range(6):
                kinetic[w] += 0.5 * momentum[n, k, w] * V[n, k, w]
            potential[w] += mass[n] * gravity * p[n, 2, w]


@kernel
def track(markers: Array, carrier: npt.NDArray[np.int64], R: Array, p: Array, out: Array) -> None:
    """World positions [M, 3, W] of markers carried at ``markers`` [M, 3] in the frames of bodies ``carrier`` [M]."""
    for m in range(len(carrier)):
        n = carrier[m]
        x, y, z = markers[m, 0], markers[m, 1], markers[m, 2]
        for i in range(3):
            for w in range(LANES):
                out[m, i, w] = p[n, i, w] + R[n, 3 * i, w] * x + R[n, 3 * i + 1, w] * y + R[n, 3 * i + 2, w] * z
