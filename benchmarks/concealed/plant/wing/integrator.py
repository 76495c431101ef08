"""Integrates one beat of a wing with a singly diagonally implicit Runge-Kutta method of fourth order.

ARK4(3)6L[2]SA, implicit part (Kennedy and Carpenter, Applied Numerical Mathematics 44, 139 (2003)): an explicit stage
and five implicit ones, stage order 2, L-stable, stiffly accurate. Rotations are Cayley vectors relative to the start of
a step, in the world frame. Each stage is solved for the velocities by a simplified Newton iteration, whose matrix
M + h C + h^2 K is symmetric (without geometric stiffness and gyroscopic terms), factored by a banded Cholesky method
and reused for some steps. The omitted terms cost iterations but no accuracy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.wing.air_loads import air_loads
from benchmarks.concealed.plant.wing.banded import factor, solve
from benchmarks.concealed.plant.wing.joint_loads import joint_loads, remembered_loads
from benchmarks.concealed.plant.wing.point_loads import point_loads
from benchmarks.concealed.plant.wing.rig import AIR_STATES, Motion, Rig
from benchmarks.concealed.plant.wing.step_matrix import assemble
from benchmarks.concealed.plant.wing.vectors import axis, cross, dot, plus, row, turn_by

Array = npt.NDArray[np.float64]

STAGES = 6
G = 0.25
C = np.array([0.0, 0.5, 83 / 250, 31 / 50, 17 / 20, 1.0])
A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [G, G, 0.0, 0.0, 0.0, 0.0],
        [8611 / 62500, -1743 / 31250, G, 0.0, 0.0, 0.0],
        [5012029 / 34652500, -654441 / 2922500, 174375 / 388108, G, 0.0, 0.0],
        [
            15267082809 / 155376265600,
            -71443401 / 120774400,
            730878875 / 902184768,
            2285395 / 8070912,
            G,
            0.0,
        ],
        [82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211, G],
    ]
)
_LENGTH = 0.1  # m, about a chord: converts rotations to displacements when they are compared
_KEPT = 4  # most steps for which a matrix is reused
_SLOW = 3  # iterations of a stage above which the matrix is computed again
_ITERATIONS = 40
_START = 1e-7  # s: length of a stage that gives the initial accelerations


class State(NamedTuple):
    """State of all N bodies at one instant, in the world frame.

    Rotations ``R`` [N, 3, 3], centres of mass ``p``, velocities ``v``, angular velocities ``w`` [N, 3], internal states
    of effects with memory ``z`` [Z].
    """

    R: Array
    p: Array
    v: Array
    w: Array
    z: Array


class _Work(NamedTuple):
    m: Motion
    load: Array  # [N + 2, 6]
    band: Array
    step: Array  # [6 N] right-hand side, then the step
    p0: Array  # [N, 3] and so on: explicit part of a stage
    g0: Array
    v0: Array
    w0: Array
    z0: Array
    g: Array  # [N, 3] Cayley vectors from the start of the step
    R0: Array
    k: Array  # [STAGES, 12 N + Z] rates of all stages


@compiled
def drive(rig: Rig, rods: Array, m: Motion) -> None:
    """Set frames N and N + 1 of ``m``, the driving rods, from their angles and rates ``rods`` [2, 2] (rad, rad/s)."""
    n, x = len(rig.mass), (rig.axle[0], rig.axle[1], rig.axle[2])
    for rod in range(2):
        c, s = math.cos(rods[rod, 0]), math.sin(rods[rod, 0])
        for j in range(3):
            for i in range(3):
                m.R[n + rod, i, j] = (1.0 - c) * x[i] * x[j]
            m.R[n + rod, j, j] += c
            m.p[n + rod, j], m.v[n + rod, j], m.w[n + rod, j] = rig.hinge[j], 0.0, rods[rod, 1] * x[j]
        m.R[n + rod, 0, 1] -= s * x[2]
        m.R[n + rod, 1, 0] += s * x[2]
        m.R[n + rod, 0, 2] += s * x[1]
        m.R[n + rod, 2, 0] -= s * x[1]
        m.R[n + rod, 1, 2] -= s * x[0]
        m.R[n + rod, 2, 1] += s * x[0]


@compiled
def loads(rig: Rig, m: Motion, old: Array, hg: float, z: Array, load: Array) -> None:
    """Set ``load`` [N + 2, 6]: force (N) and moment about the centre (N m) on bodies and rods, in the world frame.

    Also sets the internal states ``z``, by an implicit step of ``hg`` (s) from ``old``.
    """
    load[:] = 0.0
    joint_loads(rig, m, load)
    remembered_loads(rig, m, old, hg, z, load)
    first = len(rig.memory)
    if rig.air > 0.0:
        air_loads(rig, m, old, hg, z, first, load)
    point_loads(rig, m, old, hg, z, first + AIR_STATES * len(rig.area) * rig.remembers, load)
    for n in range(len(rig.mass)):
        load[n, 2] -= rig.mass[n] * rig.gravity


@compiled
def _place(rig: Rig, hg: float, work: _Work) -> None:
    """Set poses and accelerations of a stage of length ``hg`` (s) from its velocities in ``work.m``."""
    m = work.m
    for n in range(len(rig.mass)):
        w, base = row(m.w, n), row(work.g0, n)
        g = row(work.g, n)
        for _ in range(2):
            rate = plus(plus(w, 0.5, cross(w, g)), 0.25 * dot(w, g), g)
            g = plus(base, hg, rate)
        for i in range(3):
            work.g[n, i] = g[i]
            m.p[n, i] = work.p0[n, i] + hg * m.v[n, i]
            m.dv[n, i] = (m.v[n, i] - work.v0[n, i]) / hg
            m.dw[n, i] = (m.w[n, i] - work.w0[n, i]) / hg
        turn_by(g, work.R0, n, m.R)


@compiled
def _residual(rig: Rig, hg: float, work: _Work) -> None:
    """Set ``work.step`` [6 N] to hg times (load - rate of momentum), the residual of the equations of motion."""
    for n in range(len(rig.mass)):
        m, w = work.m, row(work.m.w, n)
        L, dL = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for i in range(3):
            for j in range(3):
                a = axis(m.R, n, i)
                L = plus(L, rig.inertia[n, i, j] * dot(axis(m.R, n, j), w), a)
                dL = plus(dL, rig.inertia[n, i, j] * dot(axis(m.R, n, j), row(m.dw, n)), a)
        turned = plus(dL, 1.0, cross(w, L))
        for i in range(3):
            work.step[6 * n + i] = hg * (work.load[n, i] - rig.mass[n] * m.dv[n, i])
            work.step[6 * n + 3 + i] = hg * (work.load[n, 3 + i] - turned[i])


@compiled
def _stage(rig: Rig, hg: float, tolerance: float, work: _Work, z: Array) -> int:
    """Solve a stage of length ``hg`` (s) for its velocities, starting from those in ``work.m``; also sets ``z``.

    Returns the number of Newton iterations, or -1 without convergence to ``tolerance`` (m).
    """
    m = work.m
    for iteration in range(_ITERATIONS):
        _place(rig, hg, work)
        loads(rig, m, work.z0, hg, z, work.load)
        _residual(rig, hg, work)
        solve(work.band, work.step)
        largest = 0.0
        for n in range(len(rig.mass)):
            for i in range(3):
                move, turn = work.step[6 * n + i], work.step[6 * n + 3 + i]
                m.v[n, i] += move
                m.w[n, i] += turn
                largest = max(largest, hg * abs(move), hg * _LENGTH * abs(turn))
        if not largest < 1e3:
            return -1
        if largest < tolerance:
            _place(rig, hg, work)
            return iteration + 1
    return -1


@compiled
def _base(rig: Rig, h: float, stage: int, start: State, work: _Work) -> None:
    """Set the explicit part of a Runge-Kutta stage in ``work`` (p0, g0, v0, w0, z0) from earlier stages' rates."""
    n = len(rig.mass)
    work.p0[:], work.g0[:], work.v0[:], work.w0[:], work.z0[:] = start.p, 0.0, start.v, start.w, start.z
    for j in range(stage):
        f, k = h * A[stage, j], work.k[j]
        for b in range(n):
            for i in range(3):
                work.p0[b, i] += f * k[12 * b + i]
                work.g0[b, i] += f * k[12 * b + 3 + i]
                work.v0[b, i] += f * k[12 * b + 6 + i]
                work.w0[b, i] += f * k[12 * b + 9 + i]
        for e in range(len(start.z)):
            work.z0[e] += f * k[12 * n + e]


@compiled
def _rates(rig: Rig, hg: float, stage: int, work: _Work, z: Array) -> None:
    """Set ``work.k[stage]`` to the time derivatives of all states in a solved stage of length ``hg`` (s)."""
    n, k, m = len(rig.mass), work.k[stage], work.m
    for b in range(n):
        for i in range(3):
            k[12 * b + i] = m.v[b, i]
            k[12 * b + 3 + i] = (work.g[b, i] - work.g0[b, i]) / hg
            k[12 * b + 6 + i] = m.dv[b, i]
            k[12 * b + 9 + i] = m.dw[b, i]
    for e in range(len(z)):
        k[12 * n + e] = (z[e] - work.z0[e]) / hg


@compiled
def _new_work(rig: Rig, states: int) -> _Work:
    n = len(rig.mass)
    frames = n + 2
    m = Motion(
        np.zeros((frames, 3, 3)), np.zeros((frames, 3)), np.zeros((frames, 3)), np.zeros((frames, 3)),
        np.zeros((frames, 3)), np.zeros((frames, 3)),
    )  # fmt: skip
    return _Work(
        m, np.zeros((frames, 6)), np.zeros((6 * n, 6 * (rig.reach + 1))), np.zeros(6 * n),
        np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(states),
        np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((STAGES, 12 * n + states)),
    )  # fmt: skip


@compiled
def _begin(rig: Rig, rods: Array, start: State, tolerance: float, work: _Work) -> bool:
    """Set the rates at the start of a beat by a very short implicit stage; return whether that stage converged."""
    n, z, m = len(rig.mass), start.z.copy(), work.m
    m.R[:n], m.p[:n], m.v[:n], m.w[:n] = start.R, start.p, start.v, start.w
    work.R0[:], work.g[:] = start.R, 0.0
    drive(rig, rods, m)
    _base(rig, 0.0, 0, start, work)
    assemble(rig, m, _START, work.band)
    factor(work.band)
    fine = _stage(rig, _START, 1e-6 * tolerance, work, z) > 0
    _rates(rig, _START, 0, work, z)
    return fine


@compiled
def _guess(work: _Work, hg: float, stage: int) -> None:
    """Set initial velocities of a stage: extrapolated with the accelerations of stage ``stage``, or constant if -1."""
    work.g[:] = work.g0
    for b in range(len(work.v0)):
        for i in range(3):
            work.m.v[b, i] = work.v0[b, i] + (hg * work.k[stage, 12 * b + 6 + i] if stage >= 0 else 0.0)
            work.m.w[b, i] = work.w0[b, i] + (hg * work.k[stage, 12 * b + 9 + i] if stage >= 0 else 0.0)


@compiled
def _renew(rig: Rig, hg: float, work: _Work) -> None:
    """Compute and factor the Newton matrix ``work.band`` again, at the velocities in ``work.m``."""
    _place(rig, hg, work)
    assemble(rig, work.m, hg, work.band)
    factor(work.band)


@compiled
def beat(rig: Rig, rods: Array, start: State, tolerance: float, R: Array, p: Array, z: Array) -> State:
    """Integrate a beat in n equal steps and return the state at its end, whose ``p`` is NaN if the integration fails.

    ``rods`` [n + 1, STAGES, 2 rods, 2]: angle and rate of the driving rods at all stages, rad and rad/s. ``tolerance``:
    of the Newton iteration, m. Rotations ``R`` [n, N, 3, 3], centres ``p`` [n, N, 3] and internal states ``z`` [n, Z]
    are overwritten with those at the start of each step.
    """
    n, steps = len(rig.mass), len(rods) - 1
    h = rig.period / steps
    hg = G * h
    now = State(start.R.copy(), start.p.copy(), start.v.copy(), start.w.copy(), start.z.copy())
    work, end = _new_work(rig, len(start.z)), start.z.copy()
    fine, age = _begin(rig, rods[0, 0], now, tolerance, work), _KEPT
    for step in range(steps):
        R[step], p[step], z[step] = now.R, now.p, now.z
        work.R0[:], work.g[:] = now.R, 0.0
        for stage in range(1, STAGES):
            drive(rig, rods[step, stage], work.m)
            _base(rig, h, stage, now, work)
            # a beat may start from an extrapolated state, whose accelerations are not useful
            _guess(work, hg, stage - 1 if step + stage > 1 else -1)
            if age >= _KEPT:
                _renew(rig, hg, work)
                age = 0
            took = _stage(rig, hg, tolerance, work, end)
            if took < 0:  # try again, from the velocities at the start of the step
                _guess(work, hg, -1)
                _renew(rig, hg, work)
                took = _stage(rig, hg, tolerance, work, end)
            fine = fine and took >= 0
            age = _KEPT if took > _SLOW else age
            _rates(rig, hg, stage, work, end)
        if not fine:
            break
        age += 1
        now.R[:], now.p[:], now.v[:], now.w[:] = work.m.R[:n], work.m.p[:n], work.m.v[:n], work.m.w[:n]
        now.z[:] = end
        work.k[0] = work.k[STAGES - 1]
        for b in range(n):  # the Cayley vectors of the next step start at zero
            for i in range(3):
                work.k[0, 12 * b + 3 + i] = now.w[b, i]
    if not fine:
        now.p[:] = np.nan
    return now
