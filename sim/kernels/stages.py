"""Sums over the stages of a Rosenbrock step, for each body and W individuals."""

from __future__ import annotations

from wingfit.records.array_types import Array
from wingfit.sim.kernels.bodies import body_rate
from wingfit.sim.kernels.jit import kernel
from wingfit.sim.kernels.lanes.matrices import cross, load_vector
from wingfit.sim.kernels.lanes.vector import Vector, load, load1, load3, store


@kernel
def combine(part: float, base: Array, U: Array, coefficient: Array, count: int, out: Array) -> None:
    """Set ``out`` to ``part`` ``base`` + sum_s coefficient[s] U[s] over the first ``count`` stages; U[s] [., 6, W]."""
    for i in range(out.shape[0]):
        for k in range(6):
            total = part * load(base, i, k)
            for s in range(count):
                total += coefficient[s] * load3(U, s, i, k)
            store(out, i, k, total)


@kernel
def coupled_rates(
    xi: Array, V: Array, U_xi: Array, U_V: Array, coefficient: Array, count: int, scale: float, rate: Array, lead: Array
) -> None:
    """Set ``rate`` to r + scale sum_s coefficient[s] U_xi[s] and ``lead`` to scale sum_s coefficient[s] U_V[s].

    r is the rate of the local coordinates ``xi`` [N+2, 6, W] of each body at the twist ``V``; s runs over the first
    ``count`` stages; U_xi, U_V [STAGES, N+2, 6, W]: increments of coordinates and twists.
    """
    for i in range(xi.shape[0]):
        first = body_rate(load_vector(xi, i, 0), load_vector(V, i, 0), load_vector(V, i, 3))
        for k in range(6):
            total, other = first[k], first[k] - first[k]
            for s in range(count):
                c = scale * coefficient[s]
                total += c * load3(U_xi, s, i, k)
                other += c * load3(U_V, s, i, k)
            store(rate, i, k, total)
            store(lead, i, k, other)


@kernel
def keep_stage(Y: Array, rate: Array, V: Array, length: float, U_xi: Array, U_V: Array) -> None:
    """Store the increments U_xi = l Y and U_V = (I - l A) Y - r_xi of one stage, where l is ``length``.

    A (x, y) = (x x omega / 2, x x v) for a body with the twist V = (omega, v); Y [N+2, 6, W]: solution of the stage's
    equations; ``rate``: r_xi.
    """
    for i in range(Y.shape[0]):
        turn = load_vector(Y, i, 0)
        a, b = cross(turn, load_vector(V, i, 0)), cross(turn, load_vector(V, i, 3))
        for k in range(3):
            y, z = load(Y, i, k), load(Y, i, 3 + k)
            store(U_xi, i, k, length * y)
            store(U_xi, i, 3 + k, length * z)
            store(U_V, i, k, y - load(rate, i, k) - (0.5 * length) * a[k])
            store(U_V, i, 3 + k, z - load(rate, i, 3 + k) - length * b[k])


@kernel
def place_rod(
    rod: int, turning: Vector, length: float, hinge: Array, V: Array, lead: Array, rate: Array, known: Array
) -> None:
    """Set ``known[rod]`` [6, W] to the solution Y of a stage for a driving rod, whose acceleration is prescribed.

    ``turning``: angular acceleration, rad/s^2. Y = (I - l A)^-1 (r_xi + l (lead + acceleration)) as in
    :func:`keep_stage`, with l = ``length`` and r_xi = ``rate``; A has no effect on rotation about a fixed axis.
    ``hinge`` as in :func:`wingfit.sim.kernels.integrate.set_rods`.
    """
    u, off = (load1(hinge, 0), load1(hinge, 1), load1(hinge, 2)), (load1(hinge, 3), load1(hinge, 4), load1(hinge, 5))
    sweep, v = cross(u, off), load_vector(V, rod, 3)
    for j in range(3):
        store(known, rod, j, length * (load(lead, rod, j) + u[j] * turning) + load(rate, rod, j))
    dragged = cross(load_vector(known, rod, 0), v)
    for j in range(3):
        moved = length * (load(lead, rod, 3 + j) - sweep[j] * turning + dragged[j])
        store(known, rod, 3 + j, moved + load(rate, rod, 3 + j))
