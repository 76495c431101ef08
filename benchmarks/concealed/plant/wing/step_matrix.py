"""Assembles the matrix of the integrator's Newton iteration, M + h C + h^2 K, of mass, damping and stiffness.

It is symmetric; its lower half is stored as a band matrix (:mod:`.banded`).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.wing.air_loads import carried, frame_of
from benchmarks.concealed.plant.wing.joint_loads import angle_between, dead_zone
from benchmarks.concealed.plant.wing.rig import (
    BAND,
    BRAKE,
    CABLE,
    CARRIED,
    KEEPS,
    MAXWELL,
    PARAMETER,
    PLATE,
    STIFF,
    STOP,
    TETHER,
    Motion,
    Rig,
)
from benchmarks.concealed.plant.wing.vectors import V3, ZERO, axis, cross, dot, plus, row, turned

Array = npt.NDArray[np.float64]

_SLOPE = 1e-5  # rad: step of a finite difference


@compiled
def assemble(rig: Rig, m: Motion, hg: float, band: Array) -> None:
    """Fill the band matrix ``band`` [6 N, 6 (reach + 1)] for a stage of length ``hg`` (s) at the motion ``m``."""
    band[:] = 0.0
    last = band.shape[1] - 1
    for n in range(len(rig.mass)):
        for i in range(3):
            band[6 * n + i, last] = rig.mass[n]
            for j in range(i + 1):
                total = 0.0
                for a in range(3):
                    for b in range(3):
                        total += m.R[n, i, a] * rig.inertia[n, a, b] * m.R[n, j, b]
                band[6 * n + 3 + i, last - i + j] = total
    for c in range(len(rig.first)):
        _joint(rig, m, c, hg, band)
    for e in range(len(rig.memory)):
        limit = rig.memory[e, PARAMETER]
        part = hg * hg / (1.0 + hg / limit) if rig.memory[e, KEEPS] == MAXWELL else hg * hg
        c = rig.memory_of[e]
        _couple(rig, c, axis(m.R, rig.first[c], rig.memory_axis[e]), part * rig.memory[e, STIFF], band)
    if rig.air > 0.0:
        _air(rig, m, hg, band)
    for k in range(len(rig.points)):
        _point(rig, m, k, hg, band)


@compiled
def _joint(rig: Rig, m: Motion, c: int, hg: float, band: Array) -> None:
    i, j = rig.first[c], rig.second[c]
    arm = turned(m.R, j, row(rig.b, c))
    reach = plus(plus(row(m.p, j), -1.0, row(m.p, i)), 1.0, arm)
    x, y = np.zeros(6), np.zeros(6)
    for k in range(3):
        a = axis(m.R, i, k)
        _couple(rig, c, a, hg * rig.damping[c, k] + hg * hg * _stiffness(rig, m, c, k), band)
        _fill(x, a, cross(arm, a))
        _fill(y, plus(ZERO, -1.0, a), plus(ZERO, -1.0, cross(reach, a)))
        size = hg * rig.damping[c, 3 + k] + hg * hg * rig.stiffness[c, 3 + k]
        _square(j, x, size, band)
        if i < len(rig.mass):
            _square(i, y, size, band)
            _product(j, x, i, y, size, band)


@compiled
def _stiffness(rig: Rig, m: Motion, c: int, k: int) -> float:
    """Tangent stiffness (N m/rad) of joint ``c`` about axis ``k``, with hardening and play."""
    stiff = rig.stiffness[c, k]
    if k != rig.bends[c] or (rig.hardening[c] == 0.0 and rig.play[c] == 0.0):
        return float(stiff)
    phi, slope = angle_between(m, rig.first[c], rig.second[c], k), 1.0
    if rig.hardening[c] > 0.0:
        slope = math.cosh(rig.hardening[c] * rig.curvature[c] * phi)
    if rig.play[c] > 0.0:
        more = dead_zone(phi + _SLOPE, rig.play[c]) - dead_zone(phi - _SLOPE, rig.play[c])
        slope += 0.5 * more / _SLOPE - 1.0
    return float(stiff * max(slope, 0.0))


@compiled
def _couple(rig: Rig, c: int, a: V3, size: float, band: Array) -> None:
    """Add ``size``, of a rotational spring or damper about ``a`` between the bodies of joint ``c``, to ``band``."""
    i, j = rig.first[c], rig.second[c]
    x, y = np.zeros(6), np.zeros(6)
    _fill(x, ZERO, a)
    _fill(y, ZERO, plus(ZERO, -1.0, a))
    _square(j, x, size, band)
    if i < len(rig.mass):
        _square(i, y, size, band)
        _product(j, x, i, y, size, band)


@compiled
def _fill(x: Array, force: V3, moment: V3) -> None:
    for k in range(3):
        x[k], x[3 + k] = force[k], moment[k]


@compiled
def _square(n: int, x: Array, size: float, band: Array) -> None:
    """Add size x x^T to the diagonal block of body ``n`` in ``band``; ``x`` [6]."""
    last = band.shape[1] - 1
    for i in range(6):
        for j in range(i + 1):
            band[6 * n + i, last - i + j] += size * x[i] * x[j]


@compiled
def _product(n: int, x: Array, k: int, y: Array, size: float, band: Array) -> None:
    """Add size x y^T to the block of the different bodies ``n`` and ``k`` in ``band``; ``x``, ``y`` [6]."""
    if n < k:
        n, k, x, y = k, n, y, x
    last = band.shape[1] - 1
    for i in range(6):
        for j in range(6):
            band[6 * n + i, last - 6 * (n - k) - i + j] += size * x[i] * y[j]


@compiled
def _air(rig: Rig, m: Motion, hg: float, band: Array) -> None:
    """Add the aerodynamic damping along the normal, and the added mass, of each strip as a whole to ``band``."""
    x, y = np.zeros(6), np.zeros(6)
    for s in range(len(rig.area)):
        chord, normal, u = frame_of(rig, m, s)
        flow = plus(row(rig.wind.reshape(1, 3), 0), -1.0, u)
        along, across = dot(flow, chord), dot(flow, normal)
        speed = math.sqrt(along * along + across * across)
        slope = rig.coefficients[0] + rig.coefficients[2] * abs(math.atan2(across, abs(along))) + rig.coefficients[3]
        heave = hg * 0.5 * rig.air * speed * rig.area[s] * slope
        heave += hg * rig.air * rig.area[s] * rig.air_laws[PLATE] * abs(across)
        pitch = 0.0
        if rig.air_laws[CARRIED] > 0.0:
            mass, pitch = carried(rig, s)
            heave += mass
        span = cross(normal, chord)
        for i in range(rig.strip[s], rig.strip[s + 1]):
            for j in range(rig.strip[s], i + 1):
                share = rig.weight[i] * rig.weight[j]
                for n, z in ((i, x), (j, y)):
                    arm = turned(m.R, n, (rig.centroid[n, 0], rig.centroid[n, 1], 0.0))
                    _fill(z, normal, cross(arm, normal))
                _add(i, x, j, y, share * heave, band)
                if pitch > 0.0:
                    _fill(x, ZERO, span)
                    _add(i, x, j, x, share * pitch, band)


@compiled
def _point(rig: Rig, m: Motion, k: int, hg: float, band: Array) -> None:
    """Add stiffness or damping of the load ``k`` (row of Rig.points) to ``band``, equal in all directions or axes."""
    q, n = rig.points[k], rig.point_body[k]
    arm = turned(m.R, n, (q[1], q[2], q[3]))
    v = plus(row(m.v, n), 1.0, cross(row(m.w, n), arm))
    size = 0.0
    if q[0] == BAND:
        size = hg * hg * q[7]
    elif q[0] == STOP:
        depth = max(q[5] * (m.p[n, 2] + arm[2] - q[4]), 0.0)
        size = 1.5 * hg * hg * q[6] * math.sqrt(depth)
    elif q[0] == BRAKE:
        size = 2.0 * hg * q[4] * dot(v, v)
    elif q[0] == TETHER or q[0] == CABLE:
        size = hg * hg * q[4] + hg * q[6]
    x = np.zeros(6)
    for i in range(3):
        unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
        if q[0] == CABLE:
            _fill(x, ZERO, unit)
        else:
            _fill(x, unit, cross(arm, unit))
        _square(n, x, size, band)


@compiled
def _add(i: int, x: Array, j: int, y: Array, size: float, band: Array) -> None:
    if i == j:
        _square(i, x, size, band)
    else:
        _product(i, x, j, y, size, band)
