"""Forces of the blade elements of a wing at each instant, by physical term (Armanini et al. 2016, Eqs. 1-15, 18-19).

Each term is computed for a coefficient of one, so that forces are weighted sums of these rows (ROWS, CURVE_ROWS).
Instants are independent of each other; eight of them are computed at a time, in the vector registers of the processor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.jit import allocating, inlined, kernel
from wingfit.sim.kernels.lanes.vector import Vector, load, load1, load3, root, store1, store3

ROWS = ("inertial", "translation", "rotation", "added_mass", "viscous_0", "viscous_90", "wing_acceleration")
CURVE_ROWS = ("lift_curve", "drag_curve")
(
    FLAP_RATE,  # zeta', rad/s
    FLAP_ACCELERATION,  # zeta'', rad/s^2
    PITCH_RATE,  # theta_w' at the pitch station, rad/s
    PITCH_ACCELERATION,  # rad/s^2
    DIHEDRAL,  # cosine of the wing's angle to the horizontal
    DIHEDRAL_RATE,  # of that cosine, 1/s
    PROJECTION,  # the cosine of Eq. 15
    PEELED,  # c_eff / c
    COSINE,  # of theta_w at the first element
    SINE,
    STEP_COSINE,  # of the change of theta_w from one element to the next: the twist is linear in span
    STEP_SINE,
    FORWARD,  # speed of the stream along body x, induced inflow included, m/s
    DOWNWARD,  # speed of the stream along this side's z at zero dihedral, m/s
) = range(14)
STILL = 1e-30  # m^2/s^2, avoids division by zero without flow
CHUNK = 80
TOGETHER = 4  # vectors of instants that synthesise keeps in registers
DEGREE = math.pi / 180


class Side(NamedTuple):
    """Factors on stream and force of the lower or upper wings; axes of upper ones are mirrored at the body's plane.

    Attributes:
        stream: 1, or -1 where the stream along the chord is reversed (upper wings, Eq. 18 as printed).
        printed: 1 if the whole normal component of the stream is multiplied by the cosine of the dihedral, as printed
            (Eqs. 18-19); 0 if only its part along body z is, so that a bound vortex does no work on its element.
        sign: 1 if this side's z axis is that of the body (lower wings), -1 if it is opposite (upper wings).
    """

    stream: float
    printed: float
    sign: float


class Constants(NamedTuple):
    """Constants of all elements of a wing.

    ``thickness`` b and ``width`` dr of an element (m); ``twist`` of the first element and its increment ``twist_step``
    to the next, as fractions of the twist at the pitch station; ``point``: distance d (chords) behind the axis of pitch
    of the point whose acceleration the added mass has (Armanini et al. 2016, Eqs. 18-19).
    """

    thickness: float
    width: float
    twist: float
    twist_step: float
    point: float


@inlined
def velocities(
    ct: Vector, st: Vector, swing: Vector, u: Vector, w: Vector, whole: Vector, stream: float
) -> tuple[Vector, Vector]:
    """Velocity of an element through the air along its chord and normal to it, m/s (Armanini et al. 2016, Eqs. 18-19).

    ``ct``, ``st``: cosine and sine of its pitch; ``swing``: its velocity by flapping; ``u``: speed of the stream along
    body x; ``w``: along the side's z, times the cosine of the dihedral unless :class:`Side` says ``printed`` (all m/s);
    ``whole``: factor on the normal component of the stream; ``stream``: sign of its component along the chord.
    """
    vx = swing * ct + (u * st + w * ct) * stream
    vz = whole * (u * ct - w * st) - swing * st
    return vx, vz


@inlined
def _element_forces(
    motion: Array, side: Side, r: Array, chord: Array, mass: Array, rho: float, carried: float, loading: Array,
    constants: Constants, out: Array,
) -> None:  # fmt: skip
    """Add to ``out`` [7, 2, n / W, W] the forces (N, body x and z) of one wing at n instants, in the order of ROWS.

    ``motion`` [14, n / W, W]: rows FLAP_RATE to DOWNWARD; ``rho``: density of the air, kg/m^3; ``carried``,
    ``chord`` [E], ``mass`` [E] and ``loading`` [E]: of this individual; others as in :func:`wing_forces`.
    """
    dr, d = constants.width, constants.point
    m11 = 0.25 * math.pi * rho * carried * constants.thickness**2  # Eq. 10
    for g in range(motion.shape[1]):
        flap_rate, flap_acceleration = load(motion, FLAP_RATE, g), load(motion, FLAP_ACCELERATION, g)
        pitch_rate, pitch_acceleration = load(motion, PITCH_RATE, g), load(motion, PITCH_ACCELERATION, g)
        lam, lam_rate = load(motion, DIHEDRAL, g), load(motion, DIHEDRAL_RATE, g)
        forward, downward = load(motion, FORWARD, g), load(motion, DOWNWARD, g)
        w = (lam * (1.0 - side.printed) + side.printed) * downward
        w_rate = lam_rate * (downward * (1.0 - side.printed))
        whole, whole_rate = lam * side.printed + (1.0 - side.printed), lam_rate * side.printed
        peeled = load(motion, PEELED, g)
        added = peeled * peeled * (0.25 * math.pi * rho * carried)  # m22 / c^2, Eq. 10
        ct, st = load(motion, COSINE, g), load(motion, SINE, g)
        step_ct, step_st = load(motion, STEP_COSINE, g), load(motion, STEP_SINE, g)
        x0 = lam * 0.0
        x1, x2, x3, x4, x5, x6, z0, z1, z2, z3, z4, z5, z6 = x0, x0, x0, x0, x0, x0, x0, x0, x0, x0, x0, x0, x0
        for e in range(len(r)):
            q, c, mw = constants.twist + e * constants.twist_step, chord[e], mass[e]
            rate, swing = pitch_rate * q, flap_rate * r[e]
            vx, vz = velocities(ct, st, swing, forward, w, whole, side.stream)
            along, across = forward * st + w * ct, forward * ct - w * st
            turn = flap_acceleration * r[e]
            ax = turn * ct - swing * rate * st + (rate * across + w_rate * ct) * side.stream
            az = whole_rate * across - turn * st - swing * rate * ct - whole * (rate * along + w_rate * st)
            ub, wb = vx * st + vz * ct, vx * ct - vz * st  # velocity in body axes
            m22 = added * (c * c)
            # inertial: m1 v_z theta', -m2 v_x theta' (Eqs. 12-14)
            fx, fz = (m22 + mw) * vz * rate, vx * rate * (-mw - m11)
            x0 += fx * st + fz * ct
            z0 += fx * ct - fz * st
            # circulation: -rho Gamma (v_z, -v_x) (Eq. 8); Gamma = 1/2 c |V| sin 2 alpha (Eqs. 2, 3)
            per_speed = (rho * c) / root(vx * vx + vz * vz + STILL)
            gamma = -vx * vz * (per_speed * loading[e])
            x1 += gamma * wb
            z1 -= gamma * ub
            gamma = rate * (0.5 * rho * c * c * loading[e])  # Gamma = 1/2 c^2 theta' (Eq. 2)
            x2 += gamma * wb
            z2 -= gamma * ub
            # added mass (Eq. 9), its acceleration taken d chords behind the axis of pitch (Eqs. 18-19)
            fx, fz = ax * -m11, m22 * (pitch_acceleration * (q * d * c) - az)
            x3 += fx * st + fz * ct
            z3 += fx * ct - fz * st
            # viscous: -1/2 rho c C_D |V| V with cos^2 alpha, then sin^2 alpha (Eq. 11)
            drag = vx * vx * per_speed * 0.5
            x4 -= drag * ub
            z4 -= drag * wb
            drag = vz * vz * per_speed * 0.5
            x5 -= drag * ub
            z5 -= drag * wb
            # the part of the wing's inertia that Eqs. 12-14 omit
            x6 -= (ax * st + az * ct) * mw
            z6 -= (ax * ct - az * st) * mw
            ct, st = ct * step_ct - st * step_st, st * step_ct + ct * step_st
        projection = load(motion, PROJECTION, g) * (side.sign * dr)  # Eq. 15
        for row, x, z in ((0, x0, z0), (1, x1, z1), (2, x2, z2), (3, x3, z3), (4, x4, z4), (5, x5, z5), (6, x6, z6)):
            store3(out, row, 0, g, load3(out, row, 0, g) + x * dr)
            store3(out, row, 1, g, load3(out, row, 1, g) + z * projection)


@inlined
def curve_lift(alpha: float) -> float:
    """C_L of a revolving model wing at ``alpha`` degrees, 0 to 90 (Dickinson, Lehmann and Sane 1999)."""
    return 0.225 + 1.58 * math.sin((2.13 * alpha - 7.20) * DEGREE)


@inlined
def curve_drag(alpha: float) -> float:
    """C_D of a revolving model wing at ``alpha`` degrees, 0 to 90 (Dickinson, Lehmann and Sane 1999)."""
    return 1.92 - 1.55 * math.cos((2.04 * alpha - 9.82) * DEGREE)


@inlined
def _curve_forces(
    motion: Array, side: Side, r: Array, chord: Array, rho: float, loading: Array, constants: Constants, out: Array
) -> None:
    """Add to ``out`` [2, 2, n / W, W] forces (N, body x and z) by measured steady curves, in the order of CURVE_ROWS.

    The curves of lift and drag were measured on a revolving wing; the angle of attack is folded into 0 to 90 degrees.
    Arguments as in :func:`_element_forces`.
    """
    for g in range(motion.shape[1]):
        for k in range(LANES):
            ct, st = motion[COSINE, g, k], motion[SINE, g, k]
            step_ct, step_st = motion[STEP_COSINE, g, k], motion[STEP_SINE, g, k]
            lam = motion[DIHEDRAL, g, k]
            forward = motion[FORWARD, g, k]
            w = motion[DOWNWARD, g, k] * (side.printed + (1.0 - side.printed) * lam)
            whole = (1.0 - side.printed) + side.printed * lam
            projection = side.sign * motion[PROJECTION, g, k]
            for e in range(len(r)):
                vx, vz = velocities(ct, st, motion[FLAP_RATE, g, k] * r[e], forward, w, whole, side.stream)
                ub, wb = vx * st + vz * ct, vx * ct - vz * st
                alpha = math.atan2(abs(vz), abs(vx)) / DEGREE
                lift, drag = curve_lift(alpha) * loading[e], curve_drag(alpha)
                pressure = 0.5 * rho * chord[e] * constants.width * math.sqrt(vx * vx + vz * vz)
                gamma = math.copysign(pressure * lift, -vx * vz)
                out[0, 0, g, k] += gamma * wb
                out[0, 1, g, k] -= gamma * ub * projection
                out[1, 0, g, k] -= pressure * drag * ub
                out[1, 1, g, k] -= pressure * drag * wb * projection
                ct, st = ct * step_ct - st * step_st, st * step_ct + ct * step_st


@kernel
def wing_forces(
    motion: Array, side: Side, r: Array, chord: Array, mass: Array, density: Array, carried: Array, loading: Array,
    constants: Constants, out: Array,
) -> None:  # fmt: skip
    """Add the forces of one wing of each of B individuals to ``out`` [B, 7 or 9, 2, n / W, W] along body x and z, N.

    ``motion`` [B, 14, n / W, W]: rows FLAP_RATE to DOWNWARD; ``r`` [E]: distances of E elements from the flapping axis
    in equal steps, m; ``chord`` [B, E], m; ``mass`` [B, E] of the wing per length, kg/m; ``density`` [B] of the air,
    kg/m^3; ``carried`` [B]: factor on the mass of the air that it accelerates; ``loading`` [B, E]: factor on the
    circulation. ``out`` is in the order of ROWS, then of CURVE_ROWS if it has
    9 rows.
    """
    for b in range(len(motion)):
        _element_forces(motion[b], side, r, chord[b], mass[b], density[b], carried[b], loading[b], constants, out[b])
        if out.shape[1] > len(ROWS):
            _curve_forces(motion[b], side, r, chord[b], density[b], loading[b], constants, out[b, len(ROWS) :])


@allocating
def synthesise(basis: Array, series: Array, out: Array) -> None:
    """Set ``out`` [B, T, A] to the sum over k of ``series`` [B, A, K] times ``basis``, in the order of k.

    ``basis`` [K, G, W]: K functions at G W instants, of which the first T count; G is a multiple of TOGETHER.
    """
    nothing, total = np.zeros((1, LANES)), np.empty((TOGETHER, LANES))
    for g in range(0, basis.shape[1], TOGETHER):
        start = g * LANES
        for b in range(series.shape[0]):
            for a in range(series.shape[1]):
                x0 = load1(nothing, 0)
                x1, x2, x3 = x0, x0, x0
                for k in range(len(basis)):
                    weight = series[b, a, k]
                    x0 += load(basis, k, g) * weight
                    x1 += load(basis, k, g + 1) * weight
                    x2 += load(basis, k, g + 2) * weight
                    x3 += load(basis, k, g + 3) * weight
                for row, x in ((0, x0), (1, x1), (2, x2), (3, x3)):
                    store1(total, row, x)
                for t in range(min(TOGETHER * LANES, out.shape[1] - start)):
                    out[b, start + t, a] = total[t // LANES, t % LANES]


@allocating
def synthesise_at(psi: Array, series: Array, out: Array) -> None:
    """Set ``out`` [T, A] to the values of A Fourier series of one individual at the phases ``psi`` [T], rad.

    A row of ``series`` [A, 2 K + 1] is the mean, K cosine coefficients and K sine coefficients of one series. Sines and
    cosines of the harmonics are computed by recurrence, which is much faster than computing each.
    """
    A, K = len(series), (series.shape[1] - 1) // 2
    dc, ds, c, s = np.empty((4, CHUNK))
    total = np.empty((A, CHUNK))
    for start in range(0, len(psi), CHUNK):
        size = min(CHUNK, len(psi) - start)
        for t in range(size):
            dc[t], ds[t] = math.cos(psi[start + t]), math.sin(psi[start + t])
            c[t], s[t] = 1.0, 0.0
        for a in range(A):
            total[a] = series[a, 0]
        for k in range(1, K + 1):
            for t in range(size):
                c[t], s[t] = c[t] * dc[t] - s[t] * ds[t], s[t] * dc[t] + c[t] * ds[t]
            for a in range(A):
                for t in range(size):
                    total[a, t] += series[a, k] * c[t] + series[a, K + k] * s[t]
        for a in range(A):
            for t in range(size):
                out[start + t, a] = total[a, t]
