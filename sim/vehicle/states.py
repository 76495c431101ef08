"""States of the flow over a prescribed beat (lagged circulation, attachment, inflow) and their effect on the flow.

A state is the periodic solution of a first-order differential equation.
"""

from __future__ import annotations

import math

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.jit import allocating, inlined, kernel
from wingfit.sim.kernels.lanes.vector import Vector, greatest, least, load, load0, load1, magnitude, root, store, store0
from wingfit.sim.vehicle.elements import STILL
from wingfit.sim.vehicle.stations import GROUPS

_MIN_DECAY = 1e-9  # of a state in a step: in still air the state is the mean of its target
_ROUNDS = 60  # iterations for the mean inflow, without its correlation with the force
_SWEEPS = 6  # iterations with the correlation


@inlined
def _step(before: Vector, after: Vector) -> tuple[Vector, Vector, Vector]:
    """Factors (decay, w0, w1) of a step of x' = rate (y - x): x_after = decay x + w0 y0 + w1 y1, y linear in the step.

    ``before`` and ``after``: rate at the step's start and end, times half the step; a is their sum. The decay is the
    Pade approximant (1, 2) of exp(-a), whose error is a^4 / 72 for small a and whose magnitude is below one. The
    factors add up to one, so that x = y is an exact solution for constant y.
    """
    a = greatest(before + after, _MIN_DECAY)
    below = 1.0 / (a * (a * (1.0 / 6.0) + 2.0 / 3.0) + 1.0)
    decay = (1.0 - a * (1.0 / 3.0)) * below
    slope = (a * (1.0 / 6.0) + 1.0) * below  # (1 - decay) / a
    return decay, slope - decay, 1.0 - slope


@allocating
def followed(speed: Array, share: Array, target: Array, step: float, out: Array) -> None:
    """Set ``out`` to the periodic solution x of x' = share speed (target - x) over one beat of n steps of ``step`` s.

    A sweep over the beat from x = 0 gives the periodic initial value, from which a second sweep starts. ``speed`` (m/s;
    in a step the mean of its ends), ``target`` (linear in a step) and ``out``: [sides, B, n, 8], at eight stations of B
    individuals. ``share`` [B, 8], 1/m, not negative.
    """
    n = speed.shape[2]
    start, kept = np.zeros(LANES), np.ones(LANES)
    for k in range(len(speed)):
        for b in range(speed.shape[1]):
            V, y, found = speed[k, b], target[k, b], out[k, b]
            for g in range(GROUPS):
                half = load1(share[b], g) * (0.5 * step)
                for again in range(2):
                    x = load0(start) * float(again)
                    product = x * 0.0 + 1.0
                    for t in range(n):
                        if again:
                            store(found, t, g, x)
                        later = t + 1 if t + 1 < n else 0
                        decay, old, new = _step(load(V, t, g) * half, load(V, later, g) * half)
                        x = x * decay + load(y, t, g) * old + load(y, later, g) * new
                        product *= decay
                    store0(kept, product)
                    if not again:
                        store0(start, x / (1.0 - product))


@inlined
def _angle(along: Vector, normal: Vector, speed: Vector) -> Vector:
    """Angle of attack (rad, folded into 0 to pi / 2) from the velocities along the chord and normal to it (m/s).

    It is 2 arctan(|normal| / (speed + |along|)) with their magnitude ``speed``; the arc tangent by Abramowitz and
    Stegun (1964), 4.4.49, to 2e-8.
    """
    t = magnitude(normal) / (speed + magnitude(along))
    q = t * t
    arc = q * 0.0028662257 - 0.0161657367
    for a in (0.0429096138, -0.0752896400, 0.1065626393, -0.1420889944, 0.1999355085, -0.3333314528, 1.0):
        arc = arc * q + a
    return arc * t * 2.0


@inlined
def _logistic(x: Vector) -> Vector:
    """1 / (1 + exp x), x limited to +-50, exp x being the Pade approximant (4, 4) of exp(x / 64), squared six times."""
    y = least(greatest(x, -50.0), 50.0) * (1.0 / 64.0)
    q = y * y
    even, odd = q * q * (1.0 / 1680.0) + q * (3.0 / 28.0) + 1.0, y * (q * (1.0 / 84.0) + 0.5)
    power = (even + odd) / (even - odd)
    for _ in range(6):
        power *= power
    return 1.0 / (power + 1.0)


@kernel
def steady_attachment(
    along: Array, normal: Array, speed: Array, chord: Array, stall: Array, step: float, out: Array
) -> None:
    """Set ``out`` to the attached fraction of the chord 1 / (1 + exp((alpha - tau_2 c alpha' / V - angle) / width)).

    alpha is the angle of attack (rad, folded into 0 to pi / 2), alpha' its rate (rad/s), c the ``chord`` [B, 8] (m) and
    V the ``speed``. ``along``, ``normal`` (velocity along the chord and normal to it), ``speed`` (m/s) and ``out``
    [sides, B, n, 8]; ``stall`` [B, 3]: angle and width (rad), and tau_2 in chords travelled; ``step`` between instants
    in s.
    """
    n = speed.shape[2]
    for k in range(len(speed)):
        for b in range(speed.shape[1]):
            angle, width, advance = stall[b]
            x, z, V = along[k, b], normal[k, b], speed[k, b]
            for t in range(n):
                before, after = t - 1 if t else n - 1, t + 1 if t + 1 < n else 0
                for g in range(GROUPS):
                    lead = load1(chord[b], g) * (advance * 0.5 / step)
                    vx, vz, v = load(x, t, g), load(z, t, g), load(V, t, g)
                    rise, gain = load(z, after, g) - load(z, before, g), load(x, after, g) - load(x, before, g)
                    turned = vx * rise - vz * gain
                    both = vx * vz
                    turned *= both / (magnitude(both) + STILL)  # folded: it rises where the flow turns to the normal
                    late = _angle(vx, vz, v) - turned * lead / (v * v * v)
                    store(out[k, b], t, g, _logistic((late - angle) / width))


@kernel
def separate(attached: Array, share: Array, rotation: Array, circulation: Array) -> None:
    """Reduce ``circulation`` (m^2/s), in place, where the flow is attached on only the fraction X = ``attached``.

    By Kirchhoff's law, the lift due to the angle of attack is K = ((1 + sqrt X) / 2)^2 times that of attached flow. So
    the part ``rotation`` of the circulation, due to pitching, does not change, and the rest is multiplied by
    1 - share (1 - K). ``attached`` and ``circulation`` [sides, B, n, 8]; ``rotation`` [B, n, 8]; ``share`` [B].
    """
    for k in range(len(attached)):
        for b in range(len(share)):
            lost, found, turned = share[b], circulation[k, b], rotation[b]
            for t in range(attached.shape[2]):
                for g in range(GROUPS):
                    half = root(greatest(load(attached[k, b], t, g), 0.0)) * 0.5 + 0.5
                    stays = load(turned, t, g)
                    store(found, t, g, (load(found, t, g) - stays) * (half * half * lost + (1.0 - lost)) + stays)


@kernel
def overtake(wing: Array, share: Array, wake: Array) -> None:
    """Replace the velocity w of the air in ``wake`` by ``share`` (w - w limited to the interval between 0 and u).

    u in ``wing`` is the wing's velocity along the same line: air that moves in the same direction as the wing acts only
    with its excess over u. ``wake`` and ``wing`` [sides, B, n, 8] in m/s; ``share`` [B].
    """
    for k in range(len(wake)):
        for b in range(len(share)):
            part = share[b]
            for t in range(wake.shape[2]):
                for g in range(GROUPS):
                    u, w = load(wing[k, b], t, g), load(wake[k, b], t, g)
                    ahead = greatest(greatest(w, 0.0) - greatest(u, 0.0), 0.0)
                    behind = least(least(w, 0.0) - least(u, 0.0), 0.0)
                    store(wake[k, b], t, g, (ahead + behind) * part)


@kernel
def settled_inflow(
    force: Array, slope: Array, flux: Array, mass: Array, stream: Array, step: float, out: Array
) -> None:
    """Set ``out`` [B, n] to the periodic inflow v (m/s) through the disc that the wings sweep, by the trapezoidal rule.

    v solves m v' + F V_T v = force - slope v, V_T^2 = (U_x + mean v)^2 + U_z^2. ``force`` [B, n], N: thrust without
    inflow; ``slope`` [B, n], N s/m: its decrease per inflow; ``flux`` [B]: F = 2 rho A, kg/m; ``mass`` [B]: apparent
    mass m of the air, kg; ``stream`` [B, 2]: U_x through the disc and U_z along it, m/s; ``step`` in s.
    """
    n = force.shape[1]
    for b in range(len(force)):
        f = s = 0.0
        for t in range(n):
            f += force[b, t] / n
            s += slope[b, t] / n
        mean = 0.0
        for _ in range(_ROUNDS):
            through = flux[b] * math.hypot(stream[b, 0] + mean, stream[b, 1]) + s
            # halfway to the next iterate, since it would oscillate otherwise
            mean = 0.5 * (mean + f / (through + flux[b] * 1e-3))
        for _ in range(_SWEEPS):
            through = flux[b] * math.hypot(stream[b, 0] + mean, stream[b, 1])
            mean = 0.5 * (mean + _settle(force[b], slope[b], through, mass[b] / step, out[b]))


@inlined
def _settle(force: Array, slope: Array, through: float, inertia: float, out: Array) -> float:
    """Set ``out`` [n] to the periodic v (m/s) of :func:`settled_inflow` for one individual; return its mean.

    ``through``: mass flow F V_T, kg/s; ``inertia``: m / step, kg/s; ``force`` [n], N; ``slope`` [n], N s/m.
    """
    n, start, total = len(force), 0.0, 0.0
    for again in range(2):
        v, product, total = start, 1.0, 0.0
        for t in range(n):
            later = t + 1 if t + 1 < n else 0
            out[t] = v
            total += v / n
            below = 1.0 / (inertia + 0.5 * (through + slope[later]))
            decay = (inertia - 0.5 * (through + slope[t])) * below
            v = v * decay + 0.5 * (force[t] + force[later]) * below
            product *= decay
        if not again:
            start = v / (1.0 - product)
    return total
