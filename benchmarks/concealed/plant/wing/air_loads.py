"""Air loads on the strips of a wing (van der Grinten's thesis, Eqs. 8-13), with the effects hidden in them.

Circulation lag: the normal velocity that causes lift lags by Wagner's function, with the constants of W. P. Jones
(1945): 0.165 exp(-0.041 s) + 0.335 exp(-0.32 s), s in half chords. Dynamic stall: the attached fraction f of the chord
by the exponentials of Leishman and Beddoes (1989), with a first-order lag after an angle of attack that lags too.
Leading-edge vortex: lift and drag coefficients measured by Dickinson, Lehmann and Sane (1999), beyond an angle of
attack. Added mass: that of a thin elliptic section (Munk 1924), for heave and pitch of the strip as a whole.
Rotational circulation: the normal velocity that causes lift is that at three quarters of the chord (Pistolesi 1929).
Plate drag: cross-flow principle (Hoerner 1965, ch. III) with the normal velocity of each body at its centroid. Skin
friction: that of a turbulent boundary layer, coefficient 0.074 Re^(-1/5) for each face (Prandtl 1927).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.wing.rig import (
    AIR_STATES,
    CARRIED,
    LAG,
    LAG_RATE,
    PLATE,
    SKIN,
    STALL,
    STALL_ANGLE,
    STALL_DELAY,
    TURNING,
    VORTEX,
    VORTEX_ANGLE,
    Motion,
    Rig,
)
from benchmarks.concealed.plant.wing.vectors import V3, ZERO, act, axis, cross, dot, plus, row, turned

Array = npt.NDArray[np.float64]

_TURN = math.sin(math.radians(15.0))
_STILL = 1e-9  # m/s: keeps the angle of attack defined without flow
_BEFORE, _BEYOND = math.radians(4.0), math.radians(2.5)  # S_1 and S_2 of Leishman and Beddoes
_LATE = 0.85  # T_p in chords: half of the 1.7 half chords of Leishman and Beddoes
_ONSET = math.radians(12.0)  # width of the transition to vortex flow


@compiled
def frame_of(rig: Rig, m: Motion, s: int) -> tuple[V3, V3, V3]:
    """Unit vectors of chord and normal, and velocity (m/s), of strip ``s``: means over its bodies, weighted by area."""
    x, z, u = ZERO, ZERO, ZERO
    for n in range(rig.strip[s], rig.strip[s + 1]):
        g = rig.weight[n]
        arm = turned(m.R, n, (rig.centroid[n, 0], rig.centroid[n, 1], 0.0))
        u = plus(plus(u, g, row(m.v, n)), g, cross(row(m.w, n), arm))
        x, z = plus(x, g, axis(m.R, n, 0)), plus(z, g, axis(m.R, n, 2))
    chord = plus(ZERO, 1.0 / math.sqrt(dot(x, x)), x)
    z = plus(z, -dot(z, chord), chord)
    return chord, plus(ZERO, 1.0 / math.sqrt(dot(z, z)), z), u


@compiled
def _blown(rig: Rig, m: Motion, s: int, flow: V3) -> V3:
    """Air velocity (m/s) at strip ``s``: ``flow`` plus the velocity of hidden jets that the strip passes through."""
    for k in range(len(rig.jets)):
        if int(rig.jets[k, 0]) == s:
            z = 0.0
            for n in range(rig.strip[s], rig.strip[s + 1]):
                z += rig.weight[n] * m.p[n, 2]
            away = (z - rig.jets[k, 4]) / rig.jets[k, 5]
            flow = plus(flow, math.exp(-away * away), (rig.jets[k, 1], rig.jets[k, 2], rig.jets[k, 3]))
    return flow


@compiled
def _attached(alpha: float, angle: float) -> float:
    """Fraction of the chord with attached flow in steady flow at the angle ``alpha``; stall at ``angle`` (rad)."""
    a = abs(alpha)
    if a <= angle:
        return 1.0 - 0.3 * math.exp((a - angle) / _BEFORE)
    return 0.04 + 0.66 * math.exp((angle - a) / _BEYOND)


@compiled
def _relax(old: float, rate: float, goal: float, z: Array, k: int) -> float:
    """Set z[k] by an implicit Euler step towards ``goal``, z_k = old + rate (goal - z_k), and return it."""
    z[k] = (old + rate * goal) / (1.0 + rate)
    return float(z[k])


@compiled
def _vortex(rig: Rig, alpha: float, cl: float, cd: float) -> tuple[float, float]:
    """Lift and drag coefficient: ``cl``, ``cd`` blended with those of a leading-edge vortex at large ``alpha``, rad."""
    laws, a = rig.air_laws, abs(alpha)
    x = min(max((a - laws[VORTEX_ANGLE]) / _ONSET, 0.0), 1.0)
    part, side = x * x * x * (10.0 + x * (6.0 * x - 15.0)), 1.0 if alpha >= 0.0 else -1.0
    degrees = math.degrees(a)
    measured_l = 0.225 + 1.58 * math.sin(math.radians(2.13 * degrees - 7.2))
    measured_d = 1.92 - 1.55 * math.cos(math.radians(2.04 * degrees - 9.82))
    part *= laws[VORTEX]
    return cl + part * (side * measured_l - cl), cd + part * (measured_d - cd)


@compiled
def air_loads(rig: Rig, m: Motion, old: Array, hg: float, z: Array, first: int, load: Array) -> None:
    """Add the air loads on every body to ``load`` [N + 2, 6] (force N, moment N m).

    The internal states of lag and stall are ``z`` from index ``first`` on. They are advanced from ``old`` by an
    implicit Euler step of ``hg`` (s).
    """
    for s in range(len(rig.area)):
        chord, normal, u = frame_of(rig, m, s)
        flow = plus(_blown(rig, m, s, row(rig.wind.reshape(1, 3), 0)), -1.0, u)
        along, across = dot(flow, chord), dot(flow, normal)
        felt = across
        k, laws = first + AIR_STATES * s * rig.remembers, rig.air_laws
        if laws[LAG] > 0.0:
            rate = hg * laws[LAG_RATE] * 2.0 * math.sqrt(along * along + across * across) / rig.chord[s]
            y1, y2 = _relax(old[k], 0.041 * rate, across, z, k), _relax(old[k + 1], 0.32 * rate, across, z, k + 1)
            felt = across - laws[LAG] * (0.165 * (across - y1) + 0.335 * (across - y2))
        if laws[TURNING] != 0.0:
            felt += 0.25 * laws[TURNING] * rig.chord[s] * _pitch_rate(rig, m, s, cross(normal, chord))
        speed = math.sqrt(along * along + across * across + _STILL * _STILL)
        x = min(max(along / (_TURN * speed), -1.0), 1.0)
        side = 0.5 * x * (3.0 - x * x)
        alpha = math.atan2(across, along * side)
        cl = rig.coefficients[0] * math.atan2(felt, along * side) + rig.coefficients[1]
        cd = rig.coefficients[2] * abs(alpha) + rig.coefficients[3]
        if laws[VORTEX] > 0.0:
            cl, cd = _vortex(rig, alpha, cl, cd)
        if laws[STALL] > 0.0:
            chords = hg * speed / rig.chord[s]
            late = _relax(old[k + 2], chords / _LATE, alpha, z, k + 2)
            f = _relax(old[k + 3], chords / laws[STALL_DELAY], _attached(late, laws[STALL_ANGLE]), z, k + 3)
            root = 0.5 * (1.0 + math.sqrt(min(max(f, 0.0), 1.0)))
            cl *= 1.0 - laws[STALL] * (1.0 - root * root)
        pressure = 0.5 * rig.air * speed * rig.area[s]  # the directions below contain one more factor of speed
        lift, drag = pressure * side * cl, pressure * cd
        rising = plus(plus(ZERO, lift * along, normal), -lift * across, chord)
        pulling = plus(plus(ZERO, drag * along, chord), drag * across, normal)
        for n in range(rig.strip[s], rig.strip[s + 1]):
            for force, share, place in (
                (rising, rig.lift[n, 0], rig.lift[n, 1]),
                (pulling, rig.drag[n, 0], rig.drag[n, 1]),
            ):
                here = plus(ZERO, share, force)
                act(load, n, here, cross(turned(m.R, n, (place, rig.centroid[n, 1], 0.0)), here))
        if laws[PLATE] > 0.0 or laws[SKIN] > 0.0:
            _resist(rig, m, s, chord, along, load)
        if laws[CARRIED] > 0.0:
            _carry(rig, m, s, normal, cross(normal, chord), plus(ZERO, -1.0, flow), load)


@compiled
def _pitch_rate(rig: Rig, m: Motion, s: int, span: V3) -> float:
    """Rate (rad/s, nose up) at which strip ``s`` turns about the direction ``span``: mean over its bodies by area."""
    rate = 0.0
    for n in range(rig.strip[s], rig.strip[s + 1]):
        rate += rig.weight[n] * dot(row(m.w, n), span)
    return float(rate)


@compiled
def _resist(rig: Rig, m: Motion, s: int, chord: V3, along: float, load: Array) -> None:
    """Add plate drag and skin friction of strip ``s`` to its bodies; ``along`` (m/s): flow along the ``chord``."""
    laws, wind = rig.air_laws, row(rig.wind.reshape(1, 3), 0)
    rubbing = laws[SKIN] * rig.chord[s] ** -0.2 * abs(along) ** 0.8 * along
    for n in range(rig.strip[s], rig.strip[s + 1]):
        pressure = 0.5 * rig.air * rig.weight[n] * rig.area[s]
        arm, normal = turned(m.R, n, (rig.centroid[n, 0], rig.centroid[n, 1], 0.0)), axis(m.R, n, 2)
        w = dot(normal, plus(plus(wind, -1.0, row(m.v, n)), -1.0, cross(row(m.w, n), arm)))
        force = plus(plus(ZERO, pressure * laws[PLATE] * abs(w) * w, normal), pressure * rubbing, chord)
        act(load, n, force, cross(arm, force))


@compiled
def carried(rig: Rig, s: int) -> tuple[float, float]:
    """Hidden added mass of strip ``s`` in heave, kg, and added moment of inertia in pitch about mid-chord, kg m^2."""
    half = 0.5 * rig.chord[s]
    mass = rig.air_laws[CARRIED] * rig.air * math.pi * half * half * rig.area[s] / rig.chord[s]
    return mass, 0.125 * half * half * mass


@compiled
def _carry(rig: Rig, m: Motion, s: int, normal: V3, span: V3, u: V3, load: Array) -> None:
    """Add the added-mass loads of strip ``s`` to its bodies, in proportion to their areas.

    Force -m d(n.u)/dt along the normal n and moment -J d(pitch rate)/dt, with u the velocity relative to the air, and m
    and J from :func:`carried`.
    """
    rate, turning, wheeling = 0.0, ZERO, ZERO
    for n in range(rig.strip[s], rig.strip[s + 1]):
        g = rig.weight[n]
        arm = turned(m.R, n, (rig.centroid[n, 0], rig.centroid[n, 1], 0.0))
        a = plus(row(m.dv, n), 1.0, cross(row(m.dw, n), arm))
        a = plus(a, 1.0, cross(row(m.w, n), cross(row(m.w, n), arm)))
        rate += g * dot(a, normal)
        turning, wheeling = plus(turning, g, row(m.w, n)), plus(wheeling, g, row(m.dw, n))
    rate += dot(cross(turning, normal), u)
    mass, inertia = carried(rig, s)
    for n in range(rig.strip[s], rig.strip[s + 1]):
        g = rig.weight[n]
        arm = turned(m.R, n, (rig.centroid[n, 0], rig.centroid[n, 1], 0.0))
        force = plus(ZERO, -g * mass * rate, normal)
        act(load, n, force, plus(cross(arm, force), -g * inertia * dot(wheeling, span), span))
