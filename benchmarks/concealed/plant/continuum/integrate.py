"""Integrates one beat of the rod with a singly diagonally implicit Runge-Kutta method of third order.

ARK3(2)4L[2]SA, implicit part (Kennedy and Carpenter, Applied Numerical Mathematics 44, 139 (2003)): an explicit stage
and three implicit ones, stage order 2, L-stable, stiffly accurate. Rotations are Rodrigues' vectors relative to the
start of a step (a Runge-Kutta method on the group: Munthe-Kaas, BIT 38, 92 (1998)). Each stage is solved for the nodal
velocities by a simplified Newton iteration, in the axes of the nodes' frames (:mod:`.tangent`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled
from benchmarks.concealed.plant.continuum.beam import Beam, Motion
from benchmarks.concealed.plant.continuum.external import point_loads, section_loads
from benchmarks.concealed.plant.continuum.internal import internal_loads, root_loads
from benchmarks.concealed.plant.continuum.interpolation import relate
from benchmarks.concealed.plant.continuum.tangent import WIDTH, assemble
from benchmarks.concealed.plant.wing.banded import factor, solve
from benchmarks.concealed.plant.wing.vectors import axis, cross, dot, plus, row, turn_by

Array = npt.NDArray[np.float64]

STAGES = 4
G = 1767732205903 / 4055673282236
C = np.array([0.0, 2 * G, 0.6, 1.0])
A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0],
        [G, G, 0.0, 0.0],
        [2746238789719 / 10658868560708, -640167445237 / 6845629431997, G, 0.0],
        [1471266399579 / 7840856788654, -4482444167858 / 7529755066697, 11266239266428 / 11593286722821, G],
    ]
)
_LENGTH = 0.1  # m, about a chord: converts rotations to displacements when they are compared
_KEPT = 12  # most steps for which a matrix is reused
_SLOW = 4  # iterations of a stage above which the matrix is computed again
_ITERATIONS = 40
_START = 1e-7  # s: length of a stage that gives the accelerations at the start


class State(NamedTuple):
    """State of the n nodes at one instant, in the world frame.

    Rotations ``R`` [n, 3, 3], places ``p``, velocities ``v``, angular velocities ``w`` [n, 3], internal states
    ``z`` [Z].
    """

    R: Array
    p: Array
    v: Array
    w: Array
    z: Array


class _Work(NamedTuple):
    m: Motion
    load: Array  # [n, 6]
    band: Array
    step: Array  # [6 n]
    base: Array  # [n, 12] explicit part of a stage: place, rotation, velocity, angular velocity
    z0: Array
    g: Array  # [n, 3] Rodrigues' vectors from the start of the step
    R0: Array
    k: Array  # [STAGES, n, 12] rates of all stages
    kz: Array  # [STAGES, Z]


@compiled
def new_motion(nodes: int) -> Motion:
    """A motion of ``nodes`` nodes, all zero."""
    return Motion(
        np.zeros((nodes, 3, 3)), np.zeros((nodes, 3)), np.zeros((nodes, 3)), np.zeros((nodes, 3)),
        np.zeros((nodes, 3)), np.zeros((nodes, 3)), np.zeros((nodes - 1, 3)),
    )  # fmt: skip


@compiled
def _new_work(nodes: int, states: int) -> _Work:
    return _Work(
        new_motion(nodes), np.zeros((nodes, 6)), np.zeros((6 * nodes, WIDTH)), np.zeros(6 * nodes),
        np.zeros((nodes, 12)), np.zeros(states), np.zeros((nodes, 3)), np.zeros((nodes, 3, 3)),
        np.zeros((STAGES, nodes, 12)), np.zeros((STAGES, states)),
    )  # fmt: skip


@compiled
def _place(hg: float, work: _Work) -> None:
    """Set poses and accelerations of a stage of length ``hg`` (s) from its velocities in ``work.m``."""
    m = work.m
    for n in range(len(m.p)):
        w, start, g = row(m.w, n), (work.base[n, 3], work.base[n, 4], work.base[n, 5]), row(work.g, n)
        for _ in range(2):  # g = start + hg g', with g' = w + w x g / 2 + (w.g) g / 4
            g = plus(start, hg, plus(plus(w, 0.5, cross(w, g)), 0.25 * dot(w, g), g))
        for i in range(3):
            work.g[n, i] = g[i]
            m.p[n, i] = work.base[n, i] + hg * m.v[n, i]
            m.dv[n, i] = (m.v[n, i] - work.base[n, 6 + i]) / hg
            m.dw[n, i] = (m.w[n, i] - work.base[n, 9 + i]) / hg
        turn_by(g, work.R0, n, m.R)
    relate(m)


@compiled
def all_loads(beam: Beam, m: Motion, rods: Array, old: Array, hg: float, z: Array, load: Array) -> None:
    """Set ``load`` [n, 6] to the sum of all loads on the nodes, inertia included, and ``z`` from ``old``.

    ``rods`` [2, 2]: angle (rad) and rate (rad/s) of the driving rods; ``hg``: length of the implicit step of ``z``, s.
    """
    load[:] = 0.0
    internal_loads(beam, m, old, hg, z, load)
    root_loads(beam, m, rods, load)
    section_loads(beam, m, old, hg, z, load)
    point_loads(beam, m, old, hg, z, load)


@compiled
def _renew(beam: Beam, rods: Array, hg: float, work: _Work) -> None:
    """Compute and factor the matrix of the Newton iteration again, at the velocities in ``work.m``."""
    _place(hg, work)
    assemble(beam, work.m, rods, hg, work.band)
    factor(work.band)


@compiled
def _stage(beam: Beam, rods: Array, hg: float, tolerance: float, fresh: bool, work: _Work, z: Array) -> int:
    """Solve a stage of length ``hg`` (s) for its velocities, starting from those in ``work.m``; also sets ``z``.

    ``fresh``: whether the matrix is computed again for each iteration. Returns the number of Newton iterations, or -1
    without convergence to ``tolerance`` (m).
    """
    m = work.m
    for iteration in range(_ITERATIONS):
        if fresh:
            _renew(beam, rods, hg, work)
        else:
            _place(hg, work)
        all_loads(beam, m, rods, work.z0, hg, z, work.load)
        for n in range(len(m.p)):
            for i in range(3):
                force, moment = row(work.load[:, :3], n), row(work.load[:, 3:], n)
                work.step[6 * n + i] = hg * dot(axis(m.R, n, i), force)
                work.step[6 * n + 3 + i] = hg * dot(axis(m.R, n, i), moment)
        solve(work.band, work.step)
        largest = 0.0
        for n in range(len(m.p)):
            for i in range(3):
                move, turn = work.step[6 * n + i], work.step[6 * n + 3 + i]
                for k in range(3):
                    m.v[n, k] += move * m.R[n, k, i]
                    m.w[n, k] += turn * m.R[n, k, i]
                largest = max(largest, hg * abs(move), hg * _LENGTH * abs(turn))
        if not largest < 1e3:
            return -1
        if largest < tolerance:
            _place(hg, work)
            return iteration + 1
    return -1


@compiled
def _begin_stage(h: float, stage: int, start: State, work: _Work) -> None:
    """Set the explicit part of ``stage`` of a step of ``h`` (s), and initial values of its velocities."""
    for n in range(len(start.p)):
        for i in range(3):
            work.base[n, i], work.base[n, 3 + i] = start.p[n, i], 0.0
            work.base[n, 6 + i], work.base[n, 9 + i] = start.v[n, i], start.w[n, i]
        for j in range(stage):
            for i in range(12):
                work.base[n, i] += h * A[stage, j] * work.k[j, n, i]
    work.z0[:] = start.z
    for j in range(stage):
        work.z0[:] += h * A[stage, j] * work.kz[j]


@compiled
def _guess(hg: float, stage: int, work: _Work) -> None:
    """Set initial velocities of a stage: extrapolated with the accelerations of stage ``stage``, or constant if -1."""
    m = work.m
    for n in range(len(m.p)):
        for i in range(3):
            work.g[n, i] = work.base[n, 3 + i]
            m.v[n, i] = work.base[n, 6 + i] + (hg * work.k[stage, n, 6 + i] if stage >= 0 else 0.0)
            m.w[n, i] = work.base[n, 9 + i] + (hg * work.k[stage, n, 9 + i] if stage >= 0 else 0.0)


@compiled
def _rates(hg: float, stage: int, work: _Work, z: Array) -> None:
    """Set ``work.k[stage]`` to the time derivatives of all states in a solved stage of length ``hg`` (s)."""
    k, m = work.k[stage], work.m
    for n in range(len(m.p)):
        for i in range(3):
            k[n, i], k[n, 3 + i] = m.v[n, i], (work.g[n, i] - work.base[n, 3 + i]) / hg
            k[n, 6 + i], k[n, 9 + i] = m.dv[n, i], m.dw[n, i]
    for e in range(len(z)):
        work.kz[stage, e] = (z[e] - work.z0[e]) / hg


@compiled
def _begin(beam: Beam, rods: Array, start: State, tolerance: float, work: _Work) -> bool:
    """Set the rates at the start of a beat by a very short implicit stage; return whether that stage converged."""
    z = start.z.copy()
    work.R0[:] = start.R
    _begin_stage(0.0, 0, start, work)
    _guess(_START, -1, work)
    _renew(beam, rods, _START, work)
    fine = _stage(beam, rods, _START, 1e-6 * tolerance, False, work, z) > 0
    _rates(_START, 0, work, z)
    return fine


@compiled
def beat(beam: Beam, rods: Array, start: State, tolerance: float, R: Array, p: Array) -> State:
    """Integrate a beat in n equal steps and return the state at its end, whose ``p`` is NaN if the integration fails.

    ``rods`` [n + 1, STAGES, 2 rods, 2]: angle and rate of the driving rods at all stages, rad and rad/s. ``tolerance``:
    of the Newton iteration, m. Rotations ``R`` [n, nodes, 3, 3] and places ``p`` [n, nodes, 3] are overwritten with
    those at the start of each step.
    """
    steps = len(rods) - 1
    h = beam.period / steps
    hg = G * h
    now = State(start.R.copy(), start.p.copy(), start.v.copy(), start.w.copy(), start.z.copy())
    work, end = _new_work(len(start.p), len(start.z)), start.z.copy()
    fine, age = _begin(beam, rods[0, 0], now, tolerance, work), _KEPT
    for step in range(steps):
        R[step], p[step], work.R0[:] = now.R, now.p, now.R
        for stage in range(1, STAGES):
            _begin_stage(h, stage, now, work)
            # a beat may start from an extrapolated state, whose accelerations are not useful
            _guess(hg, stage - 1 if step + stage > 1 else -1, work)
            if age >= _KEPT:
                _renew(beam, rods[step, stage], hg, work)
                age = 0
            took = _stage(beam, rods[step, stage], hg, tolerance, False, work, end)
            if took < 0:  # try again, from the velocities at the start of the step
                _guess(hg, -1, work)
                took = _stage(beam, rods[step, stage], hg, tolerance, True, work, end)
            fine = fine and took >= 0
            age = _KEPT if took > _SLOW else age
            _rates(hg, stage, work, end)
        if not fine:
            break
        age += 1
        now.R[:], now.p[:], now.v[:], now.w[:], now.z[:] = work.m.R, work.m.p, work.m.v, work.m.w, end
        work.k[0], work.kz[0] = work.k[STAGES - 1], work.kz[STAGES - 1]
        for n in range(len(now.w)):  # the Rodrigues' vectors of the next step start at zero
            for i in range(3):
                work.k[0, n, 3 + i] = now.w[n, i]
    if not fine:
        now.p[:] = np.nan
    return now
