"""The flow at eight stations along each wing over the beat, for effects that change the flow, and the resulting forces.

States that depend on the flow are integrated for several stations at the same time, as many as the kernels have lanes;
a group of stations is such a number of neighbours. The laws are those of the elements (Armanini et al. 2016, Eqs. 2-8,
11, 15, 18-19).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wingfit.records import Vehicle, WingMotion
from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.jit import allocating, inlined, kernel
from wingfit.sim.kernels.lanes.vector import load, load1, root, store
from wingfit.sim.vehicle import elements
from wingfit.sim.vehicle.elements import DEGREE, STILL, Side, curve_drag, curve_lift, velocities

STATIONS = 8  # on each wing
GROUPS = STATIONS // LANES


class Stations(NamedTuple):
    """Eight stations at the middles of equal parts of the span.

    Attributes:
        r: [8] distances from the flapping axis, m.
        chord: [8], m.
        weight: [8], m: quadrature weights along the span.
        twist: [8] wing pitch less that at the root, as a fraction of its value at the pitch station.
        mass: [8] mass of the wing per length, as a fraction of the wing's mass, 1/m.
    """

    r: Array
    chord: Array
    weight: Array
    twist: Array
    mass: Array


def _weights() -> Array:
    """Quadrature weights [8] at the middles of eighths of 0 to 1: exact for cubics, else as equal as possible."""
    powers = _MIDDLES ** np.arange(4)[:, None]
    defect = 1.0 / np.arange(1, 5) - powers.mean(axis=1)
    return 1.0 / STATIONS + powers.T @ np.linalg.solve(powers @ powers.T, defect)


_MIDDLES: Array = (np.arange(STATIONS) + 0.5) / STATIONS
_WEIGHTS = _weights()


def stations(vehicle: Vehicle, motion: WingMotion) -> Stations:
    """The eight stations of each wing of ``vehicle``; twists are relative to the pitch station of ``motion``."""
    r, at, chords = _MIDDLES * vehicle.span, [s.r for s in vehicle.stations], [s.chord for s in vehicle.stations]
    chord = np.asarray(np.interp(r, at, chords))
    twist = r / (motion.pitch_station * vehicle.span)
    return Stations(r, chord, _WEIGHTS * vehicle.span, twist, chord / float(np.trapezoid(chords, at)))


@kernel
def span_sums(values: Array, weight: Array, out: Array) -> None:
    """Set ``out`` [B, n] to the sum over eight stations of ``values`` [B, n, 8] times ``weight`` [8]."""
    for b in range(len(values)):
        for t in range(values.shape[1]):
            total = 0.0
            for e in range(STATIONS):
                total += values[b, t, e] * weight[e]
            out[b, t] = total


@kernel
def station_turns(motion: Array, cosine: Array, sine: Array) -> None:
    """Set ``cosine`` and ``sine`` [B, n, 8] of the wing's pitch at the stations, from ``motion`` [B, 14, n].

    The rows of ``motion`` are those of :mod:`wingfit.sim.vehicle.elements`, the stations being the elements.
    """
    for b in range(len(motion)):
        for t in range(motion.shape[2]):
            c, s = motion[b, elements.COSINE, t], motion[b, elements.SINE, t]
            dc, ds = motion[b, elements.STEP_COSINE, t], motion[b, elements.STEP_SINE, t]
            for e in range(cosine.shape[2]):
                cosine[b, t, e], sine[b, t, e] = c, s
                c, s = c * dc - s * ds, s * dc + c * ds


@kernel
def station_velocities(
    motion: Array, side: Side, r: Array, cosine: Array, sine: Array, along: Array, normal: Array
) -> None:
    """Set ``along``, ``normal`` [B, n, 8]: the wing's velocity through the air along its chord and normal to it, m/s.

    ``motion`` [B, 14, n]: rows as in :mod:`wingfit.sim.vehicle.elements`; ``r`` [8]: distances from the flapping axis,
    m; ``cosine`` and ``sine`` [B, n, 8]: of the wing's pitch.
    """
    for b in range(len(motion)):
        for t in range(motion.shape[2]):
            lam, w, u = motion[b, elements.DIHEDRAL, t], motion[b, elements.DOWNWARD, t], motion[b, elements.FORWARD, t]
            whole = lam * side.printed + (1.0 - side.printed)
            w *= lam * (1.0 - side.printed) + side.printed
            for g in range(GROUPS):
                ct, st = load(cosine[b], t, g), load(sine[b], t, g)
                nothing = ct * 0.0
                swing = load1(r, g) * motion[b, elements.FLAP_RATE, t]
                vx, vz = velocities(ct, st, swing, nothing + u, nothing + w, nothing + whole, side.stream)
                store(along[b], t, g, vx)
                store(normal[b], t, g, vz)


@kernel
def station_gust(cosine: Array, sine: Array, air: Array, along: Array, normal: Array) -> None:
    """Correct the wing's velocities ``along`` and ``normal`` for air moving at ``air`` in the flapping direction.

    All [B, n, 8]: velocities in m/s, along the chord and normal to it; ``cosine`` and ``sine`` of the wing's pitch.
    """
    for b in range(len(air)):
        for t in range(air.shape[1]):
            for g in range(GROUPS):
                moved = load(air[b], t, g)
                store(along[b], t, g, load(along[b], t, g) - moved * load(cosine[b], t, g))
                store(normal[b], t, g, load(normal[b], t, g) + moved * load(sine[b], t, g))


@inlined
def _attack(along: float, normal: float) -> float:
    """Angle of attack (degrees, folded into 0 to 90) of a velocity ``along`` the chord and ``normal`` to it."""
    return math.atan2(abs(normal), abs(along)) / DEGREE


@kernel
def station_circulation(
    along: Array, normal: Array, turning: Array, coefficient: Array, twist: Array, chord: Array, loading: Array,
    speed: Array, circulation: Array,
) -> None:  # fmt: skip
    """Set ``speed`` (m/s) and quasi-steady ``circulation`` (m^2/s), [B, n, 8] (Armanini et al. 2016, Eqs. 2-4, 7-8).

    ``along`` and ``normal`` [B, n, 8]: the wing's velocity through the air along its chord and normal to it, m/s;
    ``turning`` [B, n]: C_R theta_w' at the pitch station, or the term that replaces it in Eq. 2, rad/s; ``coefficient``
    [B, 2]: C_l of the sine law and the factor on the measured lift curve; ``twist`` [8]: fractions of ``turning``;
    ``chord`` [B, 8], m; ``loading`` [B, 8]: factor on the circulation.
    """
    for b in range(len(along)):
        C_l, K_l = coefficient[b, 0], coefficient[b, 1]
        for t in range(along.shape[1]):
            for g in range(GROUPS):
                c, vx, vz = load1(chord[b], g), load(along[b], t, g), load(normal[b], t, g)
                V = root(vx * vx + vz * vz + STILL)
                gamma = c * 0.5 * (c * load1(twist, g) * turning[b, t] - vx * vz / V * (2.0 * C_l))
                store(speed[b], t, g, V)
                store(circulation[b], t, g, gamma * load1(loading[b], g))
            if K_l != 0.0:
                for e in range(STATIONS):
                    x, z = along[b, t, e], normal[b, t, e]
                    lift = 0.5 * chord[b, e] * speed[b, t, e] * K_l * curve_lift(_attack(x, z)) * loading[b, e]
                    circulation[b, t, e] += math.copysign(lift, -x * z)


@kernel
def station_friction(along: Array, normal: Array, speed: Array, chord: Array, drag: Array, out: Array) -> None:
    """Set ``out`` [B, n, 8] to the viscous drag over density and speed (m^2/s), which :func:`station_forces` adds.

    Armanini et al. (2016), Eq. 11; arguments as there.
    """
    for b in range(len(along)):
        for t in range(along.shape[1]):
            for e in range(STATIONS):
                vx, vz, V = along[b, t, e], normal[b, t, e], speed[b, t, e]
                measured = drag[b, 2] * curve_drag(_attack(vx, vz)) * V
                out[b, t, e] = 0.5 * chord[b, e] * ((vx * vx * drag[b, 0] + vz * vz * drag[b, 1]) / V + measured)


@allocating
def station_forces(
    motion: Array, side: Side, cosine: Array, sine: Array, along: Array, normal: Array, speed: Array,
    circulation: Array, weight: Array, chord: Array, density: Array, drag: Array, out: Array,
) -> None:  # fmt: skip
    """Add the circulatory and viscous forces of one wing (N) to ``out`` [B, 2, n] along body x and z (Eqs. 8, 11, 15).

    ``cosine`` and ``sine`` (of the wing's pitch), ``along`` and ``normal`` (the wing's velocity through the air along
    its chord and normal to it, m/s), ``speed`` (m/s) and ``circulation`` (m^2/s): [B, n, 8]. ``motion`` [B, 14, n]:
    rows as in :mod:`wingfit.sim.vehicle.elements`; ``weight`` [8] along the span, m; ``chord`` [B, 8], m; ``density``
    [B] of the air, kg/m^3; ``drag`` [B, 3]: C_D0, C_Dpi2 and the factor on the measured drag curve.
    """
    part = np.empty((2, STATIONS))
    curve = np.empty(STATIONS)
    for b in range(len(motion)):
        C_D0, C_D90, K_d = drag[b, 0], drag[b, 1], drag[b, 2]
        for t in range(motion.shape[2]):
            if K_d != 0.0:
                for e in range(STATIONS):
                    angle = _attack(along[b, t, e], normal[b, t, e])
                    curve[e] = 0.5 * K_d * chord[b, e] * curve_drag(angle)
            for g in range(GROUPS):
                c, each = load1(chord[b], g), load1(weight, g) * density[b]
                ct, st = load(cosine[b], t, g), load(sine[b], t, g)
                vx, vz, V = load(along[b], t, g), load(normal[b], t, g), load(speed[b], t, g)
                gamma = load(circulation[b], t, g) * each
                friction = c * each * (vx * vx * C_D0 + vz * vz * C_D90) * 0.5 / V
                if K_d != 0.0:
                    friction += load1(curve, g) * each * V
                ub, wb = vx * st + vz * ct, vx * ct - vz * st
                store(part, 0, g, gamma * wb - friction * ub)
                store(part, 1, g, -(gamma * ub) - friction * wb)
            x = z = 0.0
            for e in range(STATIONS):
                x += part[0, e]
                z += part[1, e]
            out[b, 0, t] += x
            out[b, 1, t] += z * motion[b, elements.PROJECTION, t] * side.sign
