"""Loads within the rod, and those of the driving rods on its root.

Strains of a geometrically exact rod (Reissner, J. Appl. Math. Phys. 23, 795 (1972); Simo, Comput. Methods Appl. Mech.
Eng. 49, 55 (1985)): Gamma = R^T r' - r_0' (shear and extension) and K = axial(R^T R') (bending and twist), with
derivatives by the span position at rest. The stress resultants are linear in strains and in their rates (Kelvin and
Voigt), R^T (r_dot' - omega x r') and R^T omega'.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.continuum.beam import STRAINS, Beam, Motion
from benchmarks.concealed.plant.continuum.interpolation import (
    Frame,
    blend,
    curvature_at,
    frame_at,
    inward,
    outward,
)
from benchmarks.concealed.plant.wing.rig import DAHL, MAXWELL
from benchmarks.concealed.plant.wing.vectors import V3, ZERO, axis, cross, dot, plus, row, turned

Array = npt.NDArray[np.float64]


@compiled
def internal_loads(beam: Beam, m: Motion, old: Array, hg: float, z: Array, load: Array) -> None:
    """Add the loads of bending, twist, extension and shear to ``load`` [n, 6] (N, N m), in world axes.

    The last internal states in ``z`` [Z], those of springs, are advanced from ``old`` by an implicit step of ``hg``
    (s).
    """
    for q in range(len(beam.length)):
        e = q // STRAINS
        frame, along = frame_at(m, e, beam.shape, q), blend(m.p, e, beam.slope, q)
        force, moment = _resultants(beam, m, q, frame, along)
        if len(beam.memory_axis) > 0:
            moment = plus(moment, 1.0, _remembered(beam, m, q, frame, old, hg, z))
        lever = cross(along, force)
        for i in range(3):
            n, bent = 2 * e + i, -beam.length[q] * beam.slope[q, i]
            there = beam.length[q] * beam.shape[q, i]
            for k in range(3):
                load[n, k] += bent * force[k]
                load[n, 3 + k] += bent * moment[k] + there * lever[k]


@compiled
def _resultants(beam: Beam, m: Motion, q: int, frame: Frame, along: V3) -> tuple[V3, V3]:
    """Force (N) and moment (N m) of the outer on the inner part at the strain point ``q``, in world axes.

    ``along``: derivative of the reference line by y.
    """
    e = q // STRAINS
    bend = curvature_at(m, e, beam.shape, beam.slope, q)
    bending = inward(frame, blend(m.w, e, beam.slope, q))
    stretch = plus(inward(frame, along), -1.0, row(beam.before, q))
    moving = plus(blend(m.v, e, beam.slope, q), -1.0, cross(blend(m.w, e, beam.shape, q), along))
    stretching = inward(frame, moving)
    k, d = beam.stiffness[q], beam.damping[q]
    hard = hardened(beam.steep * bend[0])
    moment = (
        k[0] * hard * bend[0] + d[0] * bending[0],
        k[1] * bend[1] + d[1] * bending[1],
        k[2] * bend[2] + d[2] * bending[2],
    )
    force = (
        k[3] * stretch[0] + d[3] * stretching[0],
        k[4] * stretch[1] + d[4] * stretching[1],
        k[5] * stretch[2] + d[5] * stretching[2],
    )
    return outward(frame, force), outward(frame, moment)


@compiled
def _remembered(beam: Beam, m: Motion, q: int, frame: Frame, old: Array, hg: float, z: Array) -> V3:
    """Moment k z (N m) of the springs with an internal state z (1/m) at the strain point ``q``.

    With r the rate of curvature or twist, T the relaxation time and y the yield curvature: Maxwell (1867)
    z' = r - z / T; Dahl (1968) z' = r - |r| z / y; slider (Prandtl 1928) z' = r within -y to y. Solved in closed form.
    """
    bending = inward(frame, blend(m.w, q // STRAINS, beam.slope, q))
    count, moment = len(beam.memory_axis), ZERO
    for e in range(count):
        k = len(z) - beam.memory_stiffness.size + count * q + e
        axis, limit = beam.memory_axis[e], beam.memory_limit[e]
        r = bending[0] if axis == 0 else bending[1]
        z[k] = old[k] + hg * r
        if beam.memory_kind[e] == MAXWELL:
            z[k] /= 1.0 + hg / limit
        elif beam.memory_kind[e] == DAHL:
            z[k] /= 1.0 + hg * abs(r) / limit
        else:
            z[k] = min(max(z[k], -limit), limit)
        moment = plus(moment, beam.memory_stiffness[q, e] * z[k], frame[0] if axis == 0 else frame[1])
    return moment


@compiled
def hardened(x: float) -> float:
    """sinh(x) / x."""
    return math.sinh(x) / x if abs(x) > 1e-4 else 1.0 + x * x / 6.0


@compiled
def driver(beam: Beam, angle: float) -> Frame:
    """Frame of a driving rod at ``angle`` (rad): turned about the axle."""
    a = (beam.axle[0], beam.axle[1], beam.axle[2])
    c, s = math.cos(angle), math.sin(angle)
    x = plus(plus((c, 0.0, 0.0), (1.0 - c) * a[0], a), s, cross(a, (1.0, 0.0, 0.0)))
    y = plus(plus((0.0, c, 0.0), (1.0 - c) * a[1], a), s, cross(a, (0.0, 1.0, 0.0)))
    z = plus(plus((0.0, 0.0, c), (1.0 - c) * a[2], a), s, cross(a, (0.0, 0.0, 1.0)))
    return x, y, z


@compiled
def root_loads(beam: Beam, m: Motion, rods: Array, load: Array) -> None:
    """Add the loads of the driving rods on the root to ``load`` [n, 6].

    Springs and dampers in the axes of either rod (those of rotation half-way to the axes of the root, so that rod and
    root have equal parts), linear in Rodrigues' vector of the root's frame relative to the rod's, and in the
    displacement of the point of contact. ``rods`` [2, 2]: angle and rate of the rods, rad and rad/s.
    """
    for k in range(2):
        frame = driver(beam, rods[k, 0])
        turning = plus(ZERO, rods[k, 1], (beam.axle[0], beam.axle[1], beam.axle[2]))
        arm = turned(m.R, 0, row(beam.grip, k))
        reach = plus(plus(row(m.p, 0), 1.0, arm), -1.0, (beam.hinge[0], beam.hinge[1], beam.hinge[2]))
        off = inward(frame, plus(reach, -1.0, outward(frame, row(beam.reach, k))))
        moving = plus(plus(row(m.v, 0), 1.0, cross(row(m.w, 0), arm)), -1.0, cross(turning, reach))
        drifting, twisting = inward(frame, moving), inward(frame, plus(row(m.w, 0), -1.0, turning))
        twist, trace = ZERO, 1.0
        for j in range(3):
            twist = plus(twist, 1.0, cross(frame[j], axis(m.R, 0, j)))
            trace += dot(frame[j], axis(m.R, 0, j))
        twist = plus(ZERO, 2.0 / trace, inward(frame, twist))
        stiff, loss = beam.root_stiffness[k], beam.root_damping[k]
        moment, force = ZERO, ZERO
        for j in range(3):
            between = plus(frame[j], 1.0, axis(m.R, 0, j))  # twice an axis half-way from the rod's frame to the root's
            moment = plus(plus(moment, -0.5 * stiff[j] * twist[j], between), -loss[j] * twisting[j], frame[j])
            force = plus(force, -stiff[3 + j] * off[j] - loss[3 + j] * drifting[j], frame[j])
        moment = plus(moment, 1.0, cross(arm, force))
        for j in range(3):
            load[0, j] += force[j]
            load[0, 3 + j] += moment[j]
