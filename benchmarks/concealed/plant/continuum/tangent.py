"""Matrix of the integrator's Newton iteration, M + h C + h^2 K, of mass, damping and stiffness of the rod.

It is symmetric: material stiffness, damping, mass, and the damping and added mass of the air along the normal, without
geometric stiffness and gyroscopic terms, which cost iterations but no accuracy. Its lower half is stored as a band
matrix (:mod:`benchmarks.concealed.plant.wing.banded`).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.continuum.beam import NODES, STRAINS, Beam, Motion
from benchmarks.concealed.plant.continuum.external import carried
from benchmarks.concealed.plant.continuum.internal import driver
from benchmarks.concealed.plant.continuum.interpolation import blend, curvature_at, frame_at, outward
from benchmarks.concealed.plant.wing.rig import BAND, BRAKE, CARRIED, MAXWELL, STOP
from benchmarks.concealed.plant.wing.vectors import V3, ZERO, cross, dot, plus, row, turned

Array = npt.NDArray[np.float64]

WIDTH = 6 * NODES  # of the band


@compiled
def assemble(beam: Beam, m: Motion, rods: Array, hg: float, band: Array) -> None:
    """Fill the ``band`` [6 n, WIDTH] of the matrix for a stage of length ``hg`` (s) at the motion ``m``.

    Its rows and columns are in the axes of the nodes' frames, so that it stays valid while the wing turns. ``rods``
    [2, 2]: angles and rates of the driving rods.
    """
    band[:] = 0.0
    x = np.zeros(WIDTH)
    for q in range(len(beam.length)):
        _strain(beam, m, q, hg, x, band)
    block = np.zeros((6, 6))
    for q in range(len(beam.element)):
        _section(beam, m, q, hg, block)
        _spread(beam.element[q], beam.part, q, block, band)
    for k in range(len(beam.points)):
        _point(beam, m, k, hg, block)
        _spread(beam.point_element[k], beam.point_part, k, block, band)
    _root(beam, m, rods, hg, x, band)
    _turn(m, band)


@compiled
def _strain(beam: Beam, m: Motion, q: int, hg: float, x: Array, band: Array) -> None:
    """Add stiffness and damping at the strain point ``q``; ``x`` [WIDTH] is overwritten."""
    e = q // STRAINS
    frame, along = frame_at(m, e, beam.shape, q), blend(m.p, e, beam.slope, q)
    bend = beam.steep * curvature_at(m, e, beam.shape, beam.slope, q)[0]
    for k in range(3):
        axis = frame[k]
        hard = math.cosh(bend) if k == 0 else 1.0
        lever = cross(along, axis)
        for i in range(NODES):
            for j in range(3):
                x[6 * i + j], x[6 * i + 3 + j] = 0.0, beam.slope[q, i] * axis[j]
        size = hg * beam.damping[q, k] + hg * hg * (hard * beam.stiffness[q, k] + _remembering(beam, q, k, hg))
        _square(e, x, beam.length[q] * size, band)
        for i in range(NODES):
            for j in range(3):
                x[6 * i + j], x[6 * i + 3 + j] = beam.slope[q, i] * axis[j], -beam.shape[q, i] * lever[j]
        size = hg * beam.damping[q, 3 + k] + hg * hg * beam.stiffness[q, 3 + k]
        _square(e, x, beam.length[q] * size, band)


@compiled
def _remembering(beam: Beam, q: int, axis: int, hg: float) -> float:
    """Stiffness (N m^2) about ``axis`` of the springs with an internal state at the strain point ``q``."""
    total = 0.0
    for e in range(len(beam.memory_axis)):
        if beam.memory_axis[e] == axis:
            share = 1.0 / (1.0 + hg / beam.memory_limit[e]) if beam.memory_kind[e] == MAXWELL else 1.0
            total += share * beam.memory_stiffness[q, e]
    return total


@compiled
def _square(e: int, x: Array, size: float, band: Array) -> None:
    """Add size x x^T, with ``x`` [up to WIDTH] from the first node of element ``e`` on, to ``band``."""
    last = band.shape[1] - 1
    for i in range(len(x)):
        for j in range(i + 1):
            band[12 * e + i, last - i + j] += size * x[i] * x[j]


@compiled
def _spread(e: int, part: Array, q: int, block: Array, band: Array) -> None:
    """Add the symmetric ``block`` [6, 6] of a section, at point ``q`` of element ``e``, to ``band``."""
    last = band.shape[1] - 1
    for i in range(NODES):
        for k in range(i + 1):
            share = part[q, i] * part[q, k]
            for a in range(6):
                for b in range(a + 1 if i == k else 6):
                    band[12 * e + 6 * i + a, last - 6 * (i - k) - a + b] += share * block[a, b]


@compiled
def _section(beam: Beam, m: Motion, q: int, hg: float, block: Array) -> None:
    """Set ``block`` [6, 6] to mass, aerodynamic damping and added mass of section ``q``."""
    block[:] = 0.0
    frame = frame_at(m, beam.element[q], beam.part, q)
    arm, J = outward(frame, row(beam.moment, q)), beam.inertia[q]
    for i in range(3):
        block[i, i] = beam.mass[q]
        for j in range(3):
            for a in range(3):
                for b in range(3):
                    block[3 + i, 3 + j] += frame[a][i] * J[a, b] * frame[b][j]
    _skew(block, arm)
    if q < len(beam.area) and beam.air > 0.0:
        u = blend(m.v, beam.element[q], beam.part, q)
        flow = plus((beam.wind[0], beam.wind[1], beam.wind[2]), -1.0, u)
        along, across = dot(flow, frame[0]), dot(flow, frame[2])
        slope = beam.coefficients[0] + beam.coefficients[2] * abs(math.atan2(across, abs(along)))
        speed = math.sqrt(along * along + across * across)
        heave, pitch = hg * 0.5 * beam.air * speed * beam.area[q] * (slope + beam.coefficients[3]), 0.0
        if beam.air_laws[CARRIED] > 0.0:
            mass, pitch = carried(beam, q)
            heave += mass
        for i in range(3):
            for j in range(3):
                block[i, j] += heave * frame[2][i] * frame[2][j]
                block[3 + i, 3 + j] += pitch * frame[1][i] * frame[1][j]


@compiled
def _skew(block: Array, arm: V3) -> None:
    """Add the coupling of translation and rotation, with the first moment ``arm`` (kg m, or for a force N s), m."""
    x, y, z = arm
    for i, j, s in ((0, 1, z), (1, 2, x), (2, 0, y)):
        block[3 + i, j] -= s
        block[3 + j, i] += s
        block[i, 3 + j] += s
        block[j, 3 + i] -= s


@compiled
def _point(beam: Beam, m: Motion, k: int, hg: float, block: Array) -> None:
    """Set ``block`` [6, 6] to stiffness or damping of the load ``k`` at a point, equal in all directions."""
    c, e = beam.points[k], beam.point_element[k]
    arm = outward(frame_at(m, e, beam.point_part, k), (c[1], c[2], c[3]))
    v = plus(blend(m.v, e, beam.point_part, k), 1.0, cross(blend(m.w, e, beam.point_part, k), arm))
    size = 0.0
    if c[0] == BAND:
        size = hg * hg * c[7]
    elif c[0] == STOP:
        depth = max(c[5] * (blend(m.p, e, beam.point_part, k)[2] + arm[2] - c[4]), 0.0)
        size = 1.5 * hg * hg * c[6] * math.sqrt(depth)
    elif c[0] == BRAKE:
        size = 2.0 * hg * c[4] * dot(v, v)
    block[:] = 0.0
    for i in range(3):
        block[i, i] = size
        for j in range(3):
            block[3 + i, 3 + j] = size * ((dot(arm, arm) if i == j else 0.0) - arm[i] * arm[j])
    _skew(block, plus(ZERO, size, arm))


@compiled
def _root(beam: Beam, m: Motion, rods: Array, hg: float, x: Array, band: Array) -> None:
    """Add the springs and dampers of the driving rods at the root; ``x`` [WIDTH] is overwritten."""
    for k in range(2):
        frame, arm = driver(beam, rods[k, 0]), turned(m.R, 0, row(beam.grip, k))
        for i in range(3):
            axis, lever = frame[i], cross(arm, frame[i])
            for j in range(3):
                x[j], x[3 + j] = 0.0, axis[j]
            _square(0, x[:6], hg * beam.root_damping[k, i] + hg * hg * beam.root_stiffness[k, i], band)
            for j in range(3):
                x[j], x[3 + j] = axis[j], lever[j]
            _square(0, x[:6], hg * beam.root_damping[k, 3 + i] + hg * hg * beam.root_stiffness[k, 3 + i], band)


@compiled
def _turn(m: Motion, band: Array) -> None:
    """Convert ``band`` from world axes to those of the nodes' frames."""
    X = np.zeros((3, 3))
    for n in range(len(m.p)):
        for k in range(max(0, n - NODES + 1), n + 1):
            for a in (0, 3):
                for b in (0, 3):
                    if k < n or b < a:
                        _turn_block(m, n, k, a, b, X, band)
            if k == n:
                _turn_block(m, n, n, 0, 0, X, band)
                _turn_block(m, n, n, 3, 3, X, band)


@compiled
def _turn_block(m: Motion, n: int, k: int, a: int, b: int, X: Array, band: Array) -> None:
    """Convert the block of rows ``a`` to a + 2 of node ``n`` and columns ``b`` to b + 2 of node ``k``; X [3, 3]: work.

    Of a block on the diagonal only the lower half is stored.
    """
    first, half = band.shape[1] - 1 - 6 * (n - k) + b - a, k == n and a == b
    for i in range(3):
        for j in range(i + 1 if half else 3):
            X[i, j] = band[6 * n + a + i, first + j - i]
            if half:
                X[j, i] = X[i, j]
    for i in range(3):
        for j in range(i + 1 if half else 3):
            total = 0.0
            for c in range(3):
                for d in range(3):
                    total += m.R[n, c, i] * X[c, d] * m.R[k, d, j]
            band[6 * n + a + i, first + j - i] = total
