"""Poses and inertia of rigid bodies, for W individuals at a time.

Layout for N bodies: R [N, 9, W] row-major rotation body -> world, p [N, 3, W] centre of mass in the world (m), V [N, 6,
W] twist (angular velocity omega, velocity v) in the body frame, xi [N, 6, W] local coordinates (rotation vector theta,
displacement d) about the pose (R0, p0) at the start of the step: R = R0 exp(theta~), p = p0 + R0 d, where theta~ x =
theta x x is the matrix of the cross product. Wrenches [N, 6, W] are (moment tau, force F) in the body frame at the
centre of mass. Driving rods, where included, are two more rows.
"""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.jit import allocating, inlined, kernel
from wingfit.sim.kernels.lanes.matrices import Three, cross, store_vector
from wingfit.sim.kernels.lanes.vector import Vector, load, load0, store, store0


@kernel
def move(R0: Array, p0: Array, xi: Array, R: Array, p: Array) -> None:
    """Set ``R``, ``p`` to the poses at the local coordinates ``xi`` about the poses (R0, p0); shapes as in this module.

    sin(t)/t and (1 - cos(t))/t^2 of the rotation angle t are power series in t^2, exact to round-off for t < 1; the
    integrator treats larger rotations in one step as divergence.
    """
    for n in range(len(xi)):
        x, y, z = load(xi, n, 0), load(xi, n, 1), load(xi, n, 2)
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
        dx, dy, dz = load(xi, n, 3), load(xi, n, 4), load(xi, n, 5)
        for i in range(3):
            r0, r1, r2 = load(R0, n, 3 * i), load(R0, n, 3 * i + 1), load(R0, n, 3 * i + 2)
            store(R, n, 3 * i, r0 * e00 + r1 * e10 + r2 * e20)
            store(R, n, 3 * i + 1, r0 * e01 + r1 * e11 + r2 * e21)
            store(R, n, 3 * i + 2, r0 * e02 + r1 * e12 + r2 * e22)
            store(p, n, i, load(p0, n, i) + r0 * dx + r1 * dy + r2 * dz)


@inlined
def body_rate(theta: Three, omega: Three, v: Three) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector]:
    """Return the six rates theta', d' of the local coordinates (theta, d) of a body with the twist (omega, v).

    theta' = omega + theta x omega / 2 + theta x (theta x omega) / 12, d' = exp(theta~) v, with theta in rad. theta is
    O(step); both series are truncated at an error of fourth order in theta.
    """
    a, b = cross(theta, omega), cross(theta, v)
    c, d = cross(theta, a), cross(theta, b)
    e = cross(theta, d)
    sixth, twelfth = 1.0 / 6.0, 1.0 / 12.0
    return (
        omega[0] + 0.5 * a[0] + c[0] * twelfth,
        omega[1] + 0.5 * a[1] + c[1] * twelfth,
        omega[2] + 0.5 * a[2] + c[2] * twelfth,
        v[0] + b[0] + 0.5 * d[0] + e[0] * sixth,
        v[1] + b[1] + 0.5 * d[1] + e[1] * sixth,
        v[2] + b[2] + 0.5 * d[2] + e[2] * sixth,
    )


@kernel
def inertial(mass: Array, inertia: Array, R: Array, V: Array, gravity: float, wrench: Array) -> None:
    """Set ``wrench`` to the weight of each body and the gyroscopic terms -omega x (I omega), -m omega x v.

    ``mass`` [N] m (kg), ``inertia`` [N, 9] I (kg m^2), ``gravity`` (m/s^2, along -z of the world); R, V, ``wrench`` as
    in this module.
    """
    for n in range(len(mass)):
        m = mass[n]
        i00, i11, i22 = inertia[n, 0], inertia[n, 4], inertia[n, 8]
        i01, i02, i12 = inertia[n, 1], inertia[n, 2], inertia[n, 5]
        a, b, c = load(V, n, 0), load(V, n, 1), load(V, n, 2)
        x, y, z = load(V, n, 3), load(V, n, 4), load(V, n, 5)
        hx, hy, hz = i00 * a + i01 * b + i02 * c, i01 * a + i11 * b + i12 * c, i02 * a + i12 * b + i22 * c
        store_vector(wrench, n, 0, cross((hx, hy, hz), (a, b, c)))
        store(wrench, n, 3, -m * (b * z - c * y + gravity * load(R, n, 6)))
        store(wrench, n, 4, -m * (c * x - a * z + gravity * load(R, n, 7)))
        store(wrench, n, 5, -m * (a * y - b * x + gravity * load(R, n, 8)))


@kernel
def times_mass(mass: Array, inertia: Array, V: Array, out: Array) -> None:
    """Add the momentum M V of each body in its own frame to ``out`` [N, 6, W]; ``mass`` [N], ``inertia`` [N, 9]."""
    for n in range(len(mass)):
        m = mass[n]
        i00, i11, i22 = inertia[n, 0], inertia[n, 4], inertia[n, 8]
        i01, i02, i12 = inertia[n, 1], inertia[n, 2], inertia[n, 5]
        a, b, c = load(V, n, 0), load(V, n, 1), load(V, n, 2)
        store(out, n, 0, load(out, n, 0) + i00 * a + i01 * b + i02 * c)
        store(out, n, 1, load(out, n, 1) + i01 * a + i11 * b + i12 * c)
        store(out, n, 2, load(out, n, 2) + i02 * a + i12 * b + i22 * c)
        store(out, n, 3, load(out, n, 3) + m * load(V, n, 3))
        store(out, n, 4, load(out, n, 4) + m * load(V, n, 4))
        store(out, n, 5, load(out, n, 5) + m * load(V, n, 5))


@allocating
def kinetic_and_height(
    mass: Array, inertia: Array, p: Array, V: Array, gravity: float, kinetic: Array, potential: Array
) -> None:
    """Set ``kinetic`` to 1/2 V^T M V and ``potential`` to m g z (height z), summed over all bodies ([W] each, J)."""
    kinetic[:] = 0.0
    potential[:] = 0.0
    momentum = np.zeros_like(V)
    times_mass(mass, inertia, V, momentum)
    for n in range(len(mass)):
        for k in range(6):
            store0(kinetic, load0(kinetic) + 0.5 * load(momentum, n, k) * load(V, n, k))
        store0(potential, load0(potential) + mass[n] * gravity * load(p, n, 2))


@kernel
def track(markers: Array, carrier: Index, R: Array, p: Array, out: Array) -> None:
    """Set ``out`` [M, 3, W] to the world positions (m) of M markers at ``markers`` [M, 3] on the bodies ``carrier``.

    ``markers`` are relative to the centre of mass, in the frame of the body ``carrier`` [M]; R, p: poses of the bodies.
    """
    for m in range(len(carrier)):
        n = carrier[m]
        x, y, z = markers[m, 0], markers[m, 1], markers[m, 2]
        for i in range(3):
            store(
                out, m, i, load(p, n, i) + load(R, n, 3 * i) * x + load(R, n, 3 * i + 1) * y + load(R, n, 3 * i + 2) * z
            )
