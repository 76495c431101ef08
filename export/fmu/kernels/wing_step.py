"""Compiled functions of an exported wing: its drive at a varying flap frequency, steps of time, and its outputs.

The equations of a step are those of :func:`wingfit.sim.kernels.integrate.advance`. There a beat is periodic; here the
phase of the drive is the integral of a flap frequency that varies.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wingfit.export.fmu.kernels import board as places
from wingfit.export.fmu.kernels.inputs import TURN, followed, turn_drive
from wingfit.records.array_types import Array, Index, Mask
from wingfit.sim.kernels import LANES, arrays
from wingfit.sim.kernels.arrays import STAGES, Lanes, Setting, State, Trace, Wiring, Work
from wingfit.sim.kernels.integrate import (
    NODES,
    SLOPES,
    _to_stage,
    finish_step,
    forces,
    linearise,
    record_step,
    set_rods,
    solve_stage,
)  # fmt: skip
from wingfit.sim.kernels.jit import allocating
from wingfit.sim.kernels.motor import motor_rates, rods_of

ORDERS = 5  # angle and four derivatives by time
TERMS = 6  # of a law of the inputs: one, the flap frequency, and the first four powers of the phase lag


class Parts(NamedTuple):
    """Arrays of an exported wing besides those of the kernels; W individuals, all the same.

    ``series`` [2, K + 1, 2]: Fourier series of both rods' angle without lag (rod, harmonic, real and imaginary part),
    rad; ``wind`` [3, 3]: parts of the stream (world axes) that are constant, and per metre a second along and across
    the body; ``rows`` [L] of the laws' parameters that depend on flap frequency or phase lag; ``varying`` [TERMS, L,
    W]: their coefficients of one, the flap frequency (Hz), and powers of the phase lag (rad); ``motor`` [TERMS, MOTOR
    or 0, W]: the same of a compliant drive; ``profile`` [STAGES, 2, 3 or 6, W]: of the rods within a step; ``angles``
    [2, ORDERS]: of both rods now; ``alive`` [W].
    """

    board: Array
    series: Array
    wind: Array
    rows: Index
    varying: Array
    motor: Array
    profile: Array
    angles: Array
    alive: Mask


@allocating
def angles_at(series: Array, board: Array, t: float, out: Array) -> float:
    """Set ``out`` [2, ORDERS] to the angle of both rods (rad) and its derivatives by time, in ``t`` seconds.

    Returns the phase of the drive then, which may exceed 2 pi. The amplitude grows over the first beats.
    """
    time = board[places.SMOOTHING]
    f, f1, f2, f3, turned = followed(
        board[places.FLAPPING], board[places.FLAPPING_RATE], board[places.FREQUENCY], time, t
    )
    lag, l1, l2, l3, _ = followed(board[places.LAGGING], board[places.LAGGING_RATE], board[places.LAG], time, t)
    phase = board[places.PHASE] + TURN * turned
    l4 = 0.0
    if time > 0.0:
        l4 = -(2.0 * l3 + l2 / time) / time
    grown = np.zeros(ORDERS)
    grown[0] = 1.0
    beats = board[places.BEATS] + phase / TURN
    x, per = beats / max(board[places.RAMP], 1e-9), 1.0 / (TURN * max(board[places.RAMP], 1e-9))
    p1, p2, p3, p4 = TURN * f, TURN * f1, TURN * f2, TURN * f3
    if x < 1.0:
        e1, e2 = 30.0 * x * x * (1.0 - x) ** 2 * per, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) * per**2
        e3, e4 = 60.0 * (1.0 - 6.0 * x + 6.0 * x * x) * per**3, 60.0 * (12.0 * x - 6.0) * per**4
        grown[0] = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        _chain(e1, e2, e3, e4, p1, p2, p3, p4, grown)
    swung = np.zeros(ORDERS)
    for rod in range(2):
        at, q1, q2, q3, q4 = phase, p1, p2, p3, p4
        if rod == 1:
            at, q1, q2, q3, q4 = phase - lag, p1 - l1, p2 - l2, p3 - l3, p4 - l4
        a0 = a1 = a2 = a3 = a4 = 0.0
        dc, ds = math.cos(at), math.sin(at)
        c, s = 1.0, 0.0
        for k in range(series.shape[1]):
            even = series[rod, k, 0] * c - series[rod, k, 1] * s
            odd = -(series[rod, k, 0] * s + series[rod, k, 1] * c)
            a0 += even
            a1 += k * odd
            a2 -= k * k * even
            a3 -= k * k * k * odd
            a4 += k * k * k * k * even
            c, s = c * dc - s * ds, s * dc + c * ds
        swung[0] = a0
        _chain(a1, a2, a3, a4, q1, q2, q3, q4, swung)
        out[rod, 0] = grown[0] * swung[0]
        out[rod, 1] = grown[0] * swung[1] + grown[1] * swung[0]
        out[rod, 2] = grown[0] * swung[2] + 2.0 * grown[1] * swung[1] + grown[2] * swung[0]
        out[rod, 3] = grown[0] * swung[3] + 3.0 * (grown[1] * swung[2] + grown[2] * swung[1]) + grown[3] * swung[0]
        out[rod, 4] = grown[0] * swung[4] + 4.0 * (grown[1] * swung[3] + grown[3] * swung[1])
        out[rod, 4] += 6.0 * grown[2] * swung[2] + grown[4] * swung[0]
    return phase


@allocating
def _chain(a1: float, a2: float, a3: float, a4: float, p1: float, p2: float, p3: float, p4: float, out: Array) -> None:
    """Set ``out[1:]`` to the derivatives by time of a function; a1...: its own by a phase, p1...: the phase's."""
    out[1] = a1 * p1
    out[2] = a2 * p1 * p1 + a1 * p2
    out[3] = a3 * p1**3 + 3.0 * a2 * p1 * p2 + a1 * p3
    out[4] = a4 * p1**4 + 6.0 * a3 * p1 * p1 * p2 + a2 * (3.0 * p2 * p2 + 4.0 * p1 * p3) + a1 * p4


@allocating
def set_conditions(parts: Parts, setting: Setting, lanes: Lanes) -> None:
    """Set the stream, and what depends on the flap frequency, to the inputs of the board."""
    board, laws = parts.board, lanes.laws
    along = board[places.AIRSPEED] * math.cos(board[places.PITCH])
    across = board[places.AIRSPEED] * math.sin(board[places.PITCH])
    for w in range(LANES):
        for i in range(3):
            setting.wind[i, w] = parts.wind[0, i] + parts.wind[1, i] * along + parts.wind[2, i] * across
        for k in range(len(parts.rows)):
            laws.parameters[parts.rows[k], w] = _law_of(parts.varying[:, k, w], board)
        for k in range(len(laws.motor)):
            laws.motor[k, w] = _law_of(parts.motor[:, k, w], board)


@allocating
def _law_of(terms: Array, board: Array) -> float:
    """Return a parameter at the present flap frequency and phase lag, from its coefficients [TERMS]."""
    lag = board[places.LAGGING]
    return (
        terms[0]
        + terms[1] * board[places.FLAPPING]
        + lag * (terms[2] + lag * (terms[3] + lag * (terms[4] + lag * terms[5])))
    )


@allocating
def _enter(parts: Parts, lanes: Lanes, work: Work, state: State) -> None:
    """Place the rods of the state at the drive's angles now, and copy the state to the working arrays."""
    rods = parts.profile[0]
    if len(lanes.laws.motor):
        rods_of(parts.profile[0], state.z, work.z_rate, work.rods)
        rods = work.rods
    set_rods(rods, lanes.hinge, state)
    work.xi[:] = 0.0
    work.R[:] = state.R
    work.p[:] = state.p
    work.V[:] = state.V
    work.z[:] = state.z


@allocating
def _put(angles: Array, share: float, profile: Array) -> None:
    """Set the ``profile`` [3 or 6, W] of a rod to ``angles`` [ORDERS] and the term for explicit dependence on time."""
    for w in range(LANES):
        for k in range(min(len(profile), ORDERS)):
            profile[k, w] = angles[k]
        profile[len(profile) - 1, w] = share if len(profile) > ORDERS else angles[2] + share


@allocating
def _clock(parts: Parts, work: Work, phase: float, turn: float, stage: int) -> None:
    """Set the clock of the laws, ``phase`` (rad) being that of the stage and ``turn`` the angle of a step."""
    work.clock[arrays.NOW] = phase
    work.clock[arrays.START] = parts.board[places.PHASE]
    work.clock[arrays.SHARE] = turn * SLOPES[stage]


@allocating
def step(wiring: Wiring, setting: Setting, lanes: Lanes, work: Work, state: State, parts: Parts) -> None:
    """Advance the state by ``setting.step`` seconds, but not the drive."""
    board, angles, profile = parts.board, parts.angles, parts.profile
    angles_at(parts.series, board, 0.0, angles)
    jerk = angles[0, 3], angles[1, 3]
    compliant = len(lanes.laws.motor) > 0
    turn = TURN * board[places.FLAPPING] * setting.step
    phases = np.empty(STAGES)
    for stage in range(STAGES):
        phases[stage] = angles_at(parts.series, board, NODES[stage] * setting.step, angles)
        for rod in range(2):
            _put(angles[rod], SLOPES[stage] * setting.step * jerk[rod], profile[stage, rod])
    _enter(parts, lanes, work, state)
    for stage in range(STAGES):
        if stage > 0:
            _to_stage(work, state, stage)
        _clock(parts, work, phases[stage], turn, stage)
        forces(wiring, setting, lanes, work)
        if compliant:
            motor_rates(lanes.laws.motor, work)
        if stage == 0:
            linearise(wiring, setting, lanes, work)
        rods = profile[stage]
        if compliant:
            rods_of(profile[stage], work.z, work.z_rate, work.rods)
            rods = work.rods
        solve_stage(wiring, setting, lanes, work, rods, stage)
    finish_step(work, state, parts.alive)


@allocating
def observe(
    wiring: Wiring, setting: Setting, lanes: Lanes, work: Work, state: State, trace: Trace, parts: Parts
) -> None:
    """Set the outputs in ``trace`` (markers) and on the board (loads of the wing on the drive) to those of now."""
    board, compliant = parts.board, len(lanes.laws.motor) > 0
    set_conditions(parts, setting, lanes)
    phase = angles_at(parts.series, board, 0.0, parts.angles)
    for rod in range(2):
        _put(parts.angles[rod], 0.0, parts.profile[0, rod])
    _enter(parts, lanes, work, state)
    _clock(parts, work, phase, 0.0, 0)
    forces(wiring, setting, lanes, work)
    if compliant:
        motor_rates(lanes.laws.motor, work)
    record_step(wiring, setting, lanes, work, trace, 0)
    board[places.POWER] = 0.0
    for i in range(3):
        board[places.FORCE + i] = board[places.MOMENT + i] = 0.0
        board[places.AIR + i] = trace.air[0, i, 0]
    for rod in range(2):
        _add_load(state, lanes, trace, len(wiring.mass) + rod, rod, board)
        board[places.FRONT_ANGLE + rod] = parts.angles[rod, 0]


@allocating
def _add_load(state: State, lanes: Lanes, trace: Trace, row: int, rod: int, board: Array) -> None:
    """Add the load of the wing on a driving rod, which is body number ``row``, to the outputs on the ``board``."""
    moment, force, torque = np.zeros(3), np.zeros(3), 0.0
    for i in range(3):
        for j in range(3):
            force[i] += state.R[row, 3 * i + j, 0] * trace.rods[0, rod, 3 + j, 0]
            moment[i] += state.R[row, 3 * i + j, 0] * trace.rods[0, rod, j, 0]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        arm, other = state.p[row, j, 0] - lanes.hinge[6 + j, 0], state.p[row, k, 0] - lanes.hinge[6 + k, 0]
        board[places.FORCE + i] += force[i]
        board[places.MOMENT + i] += moment[i] + arm * force[k] - other * force[j]
        # about the axis through the true hinge, in the rod's axes
        turned = lanes.hinge[3 + j, 0] * trace.rods[0, rod, 3 + k, 0]
        turned -= lanes.hinge[3 + k, 0] * trace.rods[0, rod, 3 + j, 0]
        torque += lanes.hinge[i, 0] * (turned - trace.rods[0, rod, i, 0])
    board[places.FRONT_TORQUE + rod] = torque
    board[places.POWER] += trace.power[0, arrays.FRONT_MOTOR + rod, 0]


@allocating
def run_wing(
    wiring: Wiring, setting: Setting, lanes: Lanes, work: Work, state: State, trace: Trace, parts: Parts, dt: float
) -> int:
    """Advance the wing by ``dt`` seconds in equal steps, at least as many per beat as the board says; set the outputs.

    At ``dt`` = 0 the drive takes flap frequency and phase lag of the inputs instead.
    """
    board, count = parts.board, 0
    if dt > 0.0:
        fastest = max(board[places.FLAPPING], board[places.FREQUENCY], board[places.LEAST])
        count = max(math.ceil(dt * fastest * board[places.STEPS] - 1e-6), 1)
    else:
        board[places.FLAPPING], board[places.LAGGING] = board[places.FREQUENCY], board[places.LAG]
    for _ in range(count):
        set_conditions(parts, setting, lanes)
        here = Setting(setting.density, setting.wind, setting.gravity, dt / count)
        step(wiring, here, lanes, work, state, parts)
        turn_drive(board, dt / count)
        for w in range(LANES):
            if not parts.alive[w]:
                return places.DIVERGED
    observe(wiring, setting, lanes, work, state, trace, parts)
    return places.FINE
