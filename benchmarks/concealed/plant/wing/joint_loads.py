"""Loads of joints: springs and dampers (van der Grinten's thesis, Eqs. 4-7), and the effects hidden in them.

A joint connects frame a of its first body to frame b of its second. With their axes a_k, b_k and the vector s between
their origins, in world axes, the spring's energy is sum_k g_k (1 - a_k . b_k) + (s . A s + s . B s) / 4, where
g_k = tr(K_o) / 2 - K_o,k, K_o the rotational and k_k the translational stiffnesses, A = sum_k k_k a_k a_k^T, and B the
same with b_k.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.wing.rig import DAHL, KEEPS, MAXWELL, PARAMETER, STIFF, Motion, Rig
from benchmarks.concealed.plant.wing.vectors import ZERO, act, axis, cross, dot, plus, row, turned

Array = npt.NDArray[np.float64]

_SOFT = 0.08  # width of the soft stops, as a fraction of the play


@compiled
def joint_loads(rig: Rig, m: Motion, load: Array) -> None:
    """Add the forces (N) and moments (N m) of all springs and dampers to ``load`` [N + 2, 6], in the world frame."""
    for c in range(len(rig.first)):
        i, j = rig.first[c], rig.second[c]
        arm_a, arm_b = turned(m.R, i, row(rig.a, c)), turned(m.R, j, row(rig.b, c))
        reach = plus(plus(row(m.p, j), -1.0, row(m.p, i)), 1.0, arm_b)  # from A's centre to B's origin
        s = plus(reach, -1.0, arm_a)
        turning = plus(row(m.w, j), -1.0, row(m.w, i))
        moving = plus(plus(row(m.v, j), 1.0, cross(row(m.w, j), arm_b)), -1.0, row(m.v, i))
        moving = plus(moving, -1.0, cross(row(m.w, i), reach))
        by_a, by_b, moment, lost, dragged = ZERO, ZERO, ZERO, ZERO, ZERO
        trace = rig.stiffness[c, 0] + rig.stiffness[c, 1] + rig.stiffness[c, 2]
        for k in range(3):
            a, b, stiff = axis(m.R, i, k), axis(m.R, j, k), 0.5 * rig.stiffness[c, 3 + k]
            by_a, by_b = plus(by_a, stiff * dot(a, s), a), plus(by_b, stiff * dot(b, s), b)
            moment = plus(moment, 0.5 * trace - rig.stiffness[c, k], cross(b, a))
            lost = plus(lost, rig.damping[c, k] * dot(a, turning), a)
            dragged = plus(dragged, rig.damping[c, 3 + k] * dot(a, moving), a)
        elastic = plus(plus(ZERO, -1.0, by_a), -1.0, by_b)
        force = plus(elastic, -1.0, dragged)
        on_b = plus(plus(plus(moment, -1.0, lost), 1.0, cross(s, by_b)), 1.0, cross(arm_b, force))
        on_a = plus(plus(plus(lost, -1.0, moment), 1.0, cross(s, by_a)), -1.0, cross(arm_a, elastic))
        act(load, j, force, on_b)
        act(load, i, plus(ZERO, -1.0, force), plus(on_a, 1.0, cross(reach, dragged)))
        if rig.hardening[c] > 0.0 or rig.play[c] > 0.0:
            _bend(rig, m, c, load)


@compiled
def angle_between(m: Motion, i: int, j: int, k: int) -> float:
    """Angle (rad) of frame ``j`` relative to frame ``i`` in the motion ``m``, about axis ``k`` (0 x, 1 y)."""
    u, v = (1, 2) if k == 0 else (2, 0)
    sine = dot(axis(m.R, i, v), axis(m.R, j, u)) - dot(axis(m.R, i, u), axis(m.R, j, v))
    return math.atan2(sine, dot(axis(m.R, i, u), axis(m.R, j, u)) + dot(axis(m.R, i, v), axis(m.R, j, v)))


@compiled
def _bend(rig: Rig, m: Motion, c: int, load: Array) -> None:
    """Add the bending moment of joint ``c`` (N m) in excess of k phi to ``load``: hardening, or play at the root.

    Hardening: k phi sinh(x) / x, where x is hardening times curvature times the angle phi, and k the stiffness.
    """
    i, j, k = rig.first[c], rig.second[c], rig.bends[c]
    phi = angle_between(m, i, j, k)
    more = 0.0
    if rig.hardening[c] > 0.0:
        x = rig.hardening[c] * rig.curvature[c] * phi
        more = phi * (math.sinh(x) / x - 1.0) if abs(x) > 1e-4 else phi * x * x / 6.0
    if rig.play[c] > 0.0:
        more += dead_zone(phi, rig.play[c]) - phi
    moment = plus(ZERO, -rig.stiffness[c, k] * more, axis(m.R, i, k))
    act(load, j, ZERO, moment)
    act(load, i, ZERO, plus(ZERO, -1.0, moment))


@compiled
def dead_zone(phi: float, half: float) -> float:
    """Excess of ``phi`` beyond -half to half (rad), 0 between, with soft edges: log(1 + exp) in place of max(., 0)."""
    soft = _SOFT * half
    up, down = (phi - half) / soft, (-phi - half) / soft
    above = up if up > 30.0 else math.log1p(math.exp(up))
    below = down if down > 30.0 else math.log1p(math.exp(down))
    return soft * (above - below)


@compiled
def remembered_loads(rig: Rig, m: Motion, old: Array, hg: float, z: Array, load: Array) -> None:
    """Add the moments -k z (N m) of joints with an internal state z (rad) to ``load``, and set ``z`` [E].

    An implicit step of ``hg`` (s), z = old + hg z', solved in closed form. With r the relative rotation rate about the
    joint's axis, T the relaxation time and y the yield angle: Maxwell (1867): z' = r - z / T. Dahl (1968):
    z' = r - |r| z / y. Slider (Prandtl 1928): z' = r within -y to y.
    """
    for e in range(len(rig.memory)):
        c, k = rig.memory_of[e], rig.memory_axis[e]
        i, j = rig.first[c], rig.second[c]
        a = axis(m.R, i, k)
        r = dot(a, plus(row(m.w, j), -1.0, row(m.w, i)))
        kind, limit = rig.memory[e, KEEPS], rig.memory[e, PARAMETER]
        z[e] = old[e] + hg * r
        if kind == MAXWELL:
            z[e] /= 1.0 + hg / limit
        elif kind == DAHL:
            z[e] /= 1.0 + hg * abs(r) / limit
        else:
            z[e] = min(max(z[e], -limit), limit)
        moment = plus(ZERO, -rig.memory[e, STIFF] * z[e], a)
        act(load, j, ZERO, moment)
        act(load, i, ZERO, plus(ZERO, -1.0, moment))
