"""Hidden loads at one point of the wing: elastic band, stop, brake, tether, clamped cable, appendage.

An appendage is a mass on a spring. Of these kinds the diagnosis has the tether and the cable in its library.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.wing.rig import APPENDAGE, BAND, BRAKE, CABLE, STOP, TETHER, Motion, Rig
from benchmarks.concealed.plant.wing.vectors import V3, ZERO, act, axis, cross, dot, plus, row, turned

Array = npt.NDArray[np.float64]

_SLACK = 5e-4  # m: range over which a band becomes tight
_NOTHING = 1e-9  # m


@compiled
def _held(q: Array, place: V3, velocity: V3) -> V3:
    """Force (N) on the wing at ``place`` (m), for a row ``q`` of Rig.points; zero for an appendage and a cable.

    ``velocity``: of that point, m/s.
    """
    if q[0] == BAND:  # from a fixed point, elastic beyond its length: x, y, z, N/m, m
        away = plus((q[4], q[5], q[6]), -1.0, place)
        length = math.sqrt(dot(away, away))
        beyond = length - q[8]
        return plus(ZERO, 0.5 * q[7] * (beyond + math.sqrt(beyond * beyond + _SLACK * _SLACK)) / length, away)
    if q[0] == STOP:  # Hunt and Crossley (1975) against a plane at a height, from below (1) or above (-1)
        depth = q[5] * (place[2] - q[4])
        if depth <= 0.0:
            return ZERO
        push = q[6] * depth * math.sqrt(depth) * max(1.0 + q[7] * q[5] * velocity[2], 0.0)
        return 0.0, 0.0, -q[5] * push
    if q[0] == BRAKE:  # against the velocity, by its third power: N s^3/m^3
        return plus(ZERO, -q[4] * dot(velocity, velocity), velocity)
    if q[0] == TETHER:  # rubber cord of length q5 (m) to its place at rest, N/m at first, with a damper: N s/m
        away = plus(place, -1.0, (q[7], q[8], q[9]))
        length = math.sqrt(dot(away, away))
        ratio = 1.0 + length / q[5]  # of stretched to natural length; neo-Hookean (Treloar 1975)
        stiff = q[4] * q[5] / 3.0 * (ratio - 1.0 / (ratio * ratio)) / length if length > _NOTHING else q[4]
        return plus(plus(ZERO, -stiff, away), -q[6], velocity)
    return ZERO


@compiled
def _clamp(q: Array, m: Motion, n: int) -> V3:
    """Moment (N m) on body ``n`` of a cable along the span that is clamped to it, for a row ``q`` of Rig.points.

    The rotation of the body is one about the axis t of the cable at rest, by an angle c, and then one that turns t into
    its present axis a, by an angle b. The energy is (k b^2 + K c^2) / 2, with k = q4 in bending and K = q5 in torsion
    (N m/rad; Timoshenko, Strength of Materials (1955)). A damper q6 (N m s/rad) acts on the angular velocity.
    """
    R, t, a = m.R, (0.0, 1.0, 0.0), axis(m.R, n, 1)
    across = cross(t, a)
    sine = math.sqrt(dot(across, across))
    bent = math.atan2(sine, a[1]) / sine if sine > _NOTHING else 1.0
    s = 0.5 * math.sqrt(1.0 + R[n, 0, 0] + R[n, 1, 1] + R[n, 2, 2])  # (s, v): the rotation as a quaternion
    f = 0.25 / s
    v = (f * (R[n, 2, 1] - R[n, 1, 2]), f * (R[n, 0, 2] - R[n, 2, 0]), f * (R[n, 1, 0] - R[n, 0, 1]))
    twist = 2.0 * math.atan2(v[1], s)
    slope = plus(plus(plus(ZERO, s * s, t), s, cross(v, t)), v[1], v)  # of the twist by the rotation, times s^2 + v_y^2
    moment = plus(plus(ZERO, -q[4] * bent, across), -q[5] * twist / (s * s + v[1] * v[1]), slope)
    return plus(moment, -q[6], row(m.w, n))


@compiled
def point_loads(rig: Rig, m: Motion, old: Array, hg: float, z: Array, first: int, load: Array) -> None:
    """Add the loads of all rows of Rig.points to ``load`` [N + 2, 6].

    An appendage of mass q4 (kg) moves along the body's normal n on a spring of angular frequency w = q5 (rad/s) with
    damping ratio d = q6. v and omega are the velocity and angular velocity of the wing there. Its states,
    ``z[first + 2 k]`` and the next for row k, are the spring's displacement s and its velocity u along n: s' = u - n.v,
    u' = -(w^2 s + 2 d w s') + (omega x n).v - g n_z; they are solved in closed form, as in ``remembered_loads``.
    """
    for k in range(len(rig.points)):
        q, n = rig.points[k], rig.point_body[k]
        arm = turned(m.R, n, (q[1], q[2], q[3]))
        place = plus(row(m.p, n), 1.0, arm)
        velocity = plus(row(m.v, n), 1.0, cross(row(m.w, n), arm))
        force = _held(q, place, velocity)
        moment = ZERO
        if q[0] == CABLE:
            moment = _clamp(q, m, n)
        elif q[0] == APPENDAGE:
            normal, i = axis(m.R, n, 2), first + 2 * k
            square, loss, base = q[5] * q[5], 2.0 * q[6] * q[5], dot(normal, velocity)
            pull = dot(cross(row(m.w, n), normal), velocity) - rig.gravity * normal[2]
            # u = old_u - hg (square s + loss (u - base)) + hg pull, s = old_s + hg (u - base)
            u = old[i + 1] - hg * square * (old[i] - hg * base) + hg * (loss * base + pull)
            u /= 1.0 + hg * loss + hg * hg * square
            z[i + 1] = u
            z[i] = old[i] + hg * (u - base)
            force = plus(ZERO, q[4] * (square * z[i] + loss * (u - base)), normal)
        act(load, n, force, plus(moment, 1.0, cross(arm, force)))
