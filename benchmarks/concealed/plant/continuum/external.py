"""Loads from outside on the sections of the rod: inertia and gravity, air, and hidden loads at single points.

The air loads act on the sections at Gauss points along the span, each with its own flow and its own internal states:
the quasi-steady law of van der Grinten's thesis, Eqs. 8-13, with the effects that
:mod:`benchmarks.concealed.plant.wing.air_loads` describes.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.continuum.beam import AIR_STATES, Beam, Motion
from benchmarks.concealed.plant.continuum.interpolation import Frame, blend, frame_at, inward, outward, spread
from benchmarks.concealed.plant.wing.rig import (
    APPENDAGE,
    BAND,
    CARRIED,
    LAG,
    LAG_RATE,
    STALL,
    STALL_ANGLE,
    STALL_DELAY,
    STOP,
    VORTEX,
    VORTEX_ANGLE,
)
from benchmarks.concealed.plant.wing.vectors import V3, ZERO, cross, dot, plus, row

Array = npt.NDArray[np.float64]

_TURN = math.sin(math.radians(15.0))
_STILL = 1e-9  # m/s: keeps the angle of attack defined without flow
_SOFT_BEFORE, _SOFT_BEYOND = math.radians(4.0), math.radians(2.5)  # S_1 and S_2 of Leishman and Beddoes
_LATE = 0.85  # T_p in chords: half of the 1.7 half chords of Leishman and Beddoes
_ONSET = math.radians(12.0)  # width of the transition to vortex flow
_SLACK = 5e-4  # m: range over which a band becomes tight


@compiled
def section_loads(beam: Beam, m: Motion, old: Array, hg: float, z: Array, load: Array) -> None:
    """Add the loads on all sections to ``load`` [n, 6] (N, N m), in world axes.

    The internal states of the air are advanced from ``old`` to ``z`` [Z] by an implicit Euler step of ``hg`` (s).
    """
    for q in range(len(beam.element)):
        e = beam.element[q]
        frame = frame_at(m, e, beam.part, q)
        w, dw = blend(m.w, e, beam.part, q), blend(m.dw, e, beam.part, q)
        a = blend(m.dv, e, beam.part, q)
        force, moment = _inertia(beam, q, frame, w, dw, plus(a, 1.0, (0.0, 0.0, beam.gravity)))
        if q < len(beam.area) and beam.air > 0.0:
            u = blend(m.v, e, beam.part, q)
            pushed, pitched = _air(beam, q, frame, u, old, hg, z)
            force, moment = plus(force, 1.0, pushed), plus(moment, 1.0, pitched)
            if beam.air_laws[CARRIED] > 0.0:
                pushed, pitched = _carried_loads(beam, q, frame, (u, a, w, dw))
                force, moment = plus(force, 1.0, pushed), plus(moment, 1.0, pitched)
        spread(load, e, beam.part, q, force, moment)


@compiled
def _inertia(beam: Beam, q: int, frame: Frame, w: V3, dw: V3, a: V3) -> tuple[V3, V3]:
    """Force and moment of the inertia of section ``q`` with the acceleration ``a`` (m/s^2) of mid-chord."""
    arm, J = outward(frame, row(beam.moment, q)), beam.inertia[q]
    spin, rise = inward(frame, w), inward(frame, dw)
    L, dL = ZERO, ZERO
    for i in range(3):
        L = plus(L, J[i, 0] * spin[0] + J[i, 1] * spin[1] + J[i, 2] * spin[2], frame[i])
        dL = plus(dL, J[i, 0] * rise[0] + J[i, 1] * rise[1] + J[i, 2] * rise[2], frame[i])
    force = plus(plus(plus(ZERO, beam.mass[q], a), 1.0, cross(dw, arm)), 1.0, cross(w, cross(w, arm)))
    moment = plus(plus(dL, 1.0, cross(w, L)), 1.0, cross(arm, a))
    return plus(ZERO, -1.0, force), plus(ZERO, -1.0, moment)


@compiled
def _relax(old: float, rate: float, goal: float, z: Array, k: int) -> float:
    """Set z[k] by an implicit Euler step towards ``goal``, z_k = old + rate (goal - z_k), and return it."""
    z[k] = (old + rate * goal) / (1.0 + rate)
    return float(z[k])


@compiled
def _air(beam: Beam, q: int, frame: Frame, u: V3, old: Array, hg: float, z: Array) -> tuple[V3, V3]:
    """Force and moment about mid-chord of the air on section ``q``, whose mid-chord has the velocity ``u`` (m/s)."""
    chord, normal = frame[0], frame[2]
    flow = plus((beam.wind[0], beam.wind[1], beam.wind[2]), -1.0, u)
    along, across = dot(flow, chord), dot(flow, normal)
    speed = math.sqrt(along * along + across * across + _STILL * _STILL)
    # lift changes its direction with that of the flow along the chord, smoothly
    x = min(max(along / (_TURN * speed), -1.0), 1.0)
    side = 0.5 * x * (3.0 - x * x)
    cl, cd = _coefficients(beam, q, along * side, across, speed, old, hg, z)
    pressure = 0.5 * beam.air * speed * beam.area[q]  # the directions below contain one more factor of speed
    lift, drag = pressure * side * cl, pressure * cd
    rising = plus(plus(ZERO, lift * along, normal), -lift * across, chord)
    pulling = plus(plus(ZERO, drag * along, chord), drag * across, normal)
    moment = plus(plus(ZERO, beam.lift[q], cross(chord, rising)), beam.drag[q], cross(chord, pulling))
    return plus(rising, 1.0, pulling), moment


@compiled
def _coefficients(
    beam: Beam, q: int, ahead: float, across: float, speed: float, old: Array, hg: float, z: Array
) -> tuple[float, float]:
    """Lift and drag coefficient of section ``q`` in the flow (``ahead``, ``across``) of magnitude ``speed`` (m/s)."""
    laws, k, felt = beam.air_laws, AIR_STATES * q * beam.remembers, across
    if laws[LAG] > 0.0:  # Wagner's function by W. P. Jones (1945)
        rate = hg * laws[LAG_RATE] * 2.0 * speed / beam.chord[q]
        y1, y2 = _relax(old[k], 0.041 * rate, across, z, k), _relax(old[k + 1], 0.32 * rate, across, z, k + 1)
        felt = across - laws[LAG] * (0.165 * (across - y1) + 0.335 * (across - y2))
    alpha = math.atan2(across, ahead)
    cl = beam.coefficients[0] * math.atan2(felt, ahead) + beam.coefficients[1]
    cd = beam.coefficients[2] * abs(alpha) + beam.coefficients[3]
    if laws[VORTEX] > 0.0:
        cl, cd = _vortex(laws[VORTEX], laws[VORTEX_ANGLE], alpha, cl, cd)
    if laws[STALL] > 0.0:
        chords = hg * speed / beam.chord[q]
        late = _relax(old[k + 2], chords / _LATE, alpha, z, k + 2)
        f = _relax(old[k + 3], chords / laws[STALL_DELAY], _attached(late, laws[STALL_ANGLE]), z, k + 3)
        root = 0.5 * (1.0 + math.sqrt(min(max(f, 0.0), 1.0)))
        cl *= 1.0 - laws[STALL] * (1.0 - root * root)
    return cl, cd


@compiled
def _vortex(strength: float, start: float, alpha: float, cl: float, cd: float) -> tuple[float, float]:
    """``cl``, ``cd`` blended with those of a leading-edge vortex beyond ``start`` (rad) (Dickinson et al. 1999)."""
    a = abs(alpha)
    x = min(max((a - start) / _ONSET, 0.0), 1.0)
    part, side = strength * x * x * x * (10.0 + x * (6.0 * x - 15.0)), 1.0 if alpha >= 0.0 else -1.0
    measured_l = 0.225 + 1.58 * math.sin(2.13 * a - math.radians(7.2))
    measured_d = 1.92 - 1.55 * math.cos(2.04 * a - math.radians(9.82))
    return cl + part * (side * measured_l - cl), cd + part * (measured_d - cd)


@compiled
def _attached(alpha: float, angle: float) -> float:
    """Fraction of the chord with attached flow in steady flow at ``alpha``; stall at ``angle`` (rad)."""
    a = abs(alpha)
    if a <= angle:
        return 1.0 - 0.3 * math.exp((a - angle) / _SOFT_BEFORE)
    return 0.04 + 0.66 * math.exp((angle - a) / _SOFT_BEYOND)


@compiled
def carried(beam: Beam, q: int) -> tuple[float, float]:
    """Added mass (kg) of section ``q`` in heave and moment of inertia (kg m^2) in pitch about mid-chord (Munk 1924)."""
    half = 0.5 * beam.chord[q]
    mass = beam.air_laws[CARRIED] * beam.air * math.pi * half * half * beam.area[q] / beam.chord[q]
    return mass, 0.125 * half * half * mass


@compiled
def _carried_loads(beam: Beam, q: int, frame: Frame, moving: tuple[V3, V3, V3, V3]) -> tuple[V3, V3]:
    """Force -m d(n.u)/dt along the normal n and moment -J d(pitch rate)/dt of the added mass.

    u: velocity relative to the air; m and J: from :func:`carried`. ``moving``: velocity, acceleration, angular velocity
    and angular acceleration of the section.
    """
    u, a, w, dw = moving
    normal, span = frame[2], frame[1]
    through = plus(u, -1.0, (beam.wind[0], beam.wind[1], beam.wind[2]))
    rate = dot(a, normal) + dot(cross(w, normal), through)
    mass, inertia = carried(beam, q)
    return plus(ZERO, -mass * rate, normal), plus(ZERO, -inertia * dot(dw, span), span)


@compiled
def point_loads(beam: Beam, m: Motion, old: Array, hg: float, z: Array, load: Array) -> None:
    """Add the hidden loads at single points, rows of ``beam.points``, to ``load`` [n, 6].

    The internal states of a mass on a spring are advanced from ``old`` to ``z`` [Z] by an implicit step of ``hg`` (s).
    """
    for k in range(len(beam.points)):
        c, e = beam.points[k], beam.point_element[k]
        arm = outward(frame_at(m, e, beam.point_part, k), (c[1], c[2], c[3]))
        place = plus(blend(m.p, e, beam.point_part, k), 1.0, arm)
        velocity = plus(blend(m.v, e, beam.point_part, k), 1.0, cross(blend(m.w, e, beam.point_part, k), arm))
        if c[0] == APPENDAGE:
            w, normal = blend(m.w, e, beam.point_part, k), outward(frame_at(m, e, beam.point_part, k), (0.0, 0.0, 1.0))
            pull = dot(cross(w, normal), velocity) - beam.gravity * normal[2]
            i = AIR_STATES * len(beam.area) * beam.remembers + 2 * k
            force = plus(ZERO, _shaken(c, dot(normal, velocity), pull, old, hg, z, i), normal)
        else:
            force = _held(c, place, velocity)
        spread(load, e, beam.point_part, k, force, cross(arm, force))


@compiled
def _shaken(c: Array, base: float, pull: float, old: Array, hg: float, z: Array, i: int) -> float:
    """Force (N) along the normal of a mass c[4] (kg) on a spring of c[5] (rad/s) with the damping ratio c[6].

    Den Hartog, Mechanical Vibrations (1956), ch. 3. z[i]: displacement s of the spring; z[i + 1]: velocity u of the
    mass along the normal; s' = u - base, u' = pull - c5^2 s - 2 c6 c5 s', solved in closed form.
    """
    square, loss = c[5] * c[5], 2.0 * c[6] * c[5]
    u = old[i + 1] - hg * square * (old[i] - hg * base) + hg * (loss * base + pull)
    z[i + 1] = u / (1.0 + hg * loss + hg * hg * square)
    z[i] = old[i] + hg * (z[i + 1] - base)
    return float(c[4] * (square * z[i] + loss * (z[i + 1] - base)))


@compiled
def _held(c: Array, place: V3, velocity: V3) -> V3:
    """Force (N) of an elastic band, a stop or a brake on the wing at ``place`` (m) that moves at ``velocity`` (m/s)."""
    if c[0] == BAND:  # to the fixed point c[4:7], c[7] N/m beyond the length c[8]
        away = plus((c[4], c[5], c[6]), -1.0, place)
        length = math.sqrt(dot(away, away))
        beyond = length - c[8]
        return plus(ZERO, 0.5 * c[7] * (beyond + math.sqrt(beyond * beyond + _SLACK * _SLACK)) / length, away)
    if c[0] == STOP:  # Hunt and Crossley (1975), against a plane at the height c[4], from below if c[5] = 1
        depth = max(c[5] * (place[2] - c[4]), 0.0)
        push = c[6] * depth * math.sqrt(depth) * max(1.0 + c[7] * c[5] * velocity[2], 0.0)
        return 0.0, 0.0, -c[5] * push
    return plus(ZERO, -c[4] * dot(velocity, velocity), velocity)  # brake: cube of the speed
