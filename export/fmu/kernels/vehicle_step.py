"""Compiled functions of an exported vehicle: its wings' motion and forces at one instant.

The equations are those of :mod:`wingfit.sim.vehicle`, where a whole beat is computed at once: flap angle and pitch are
functions of the phase, whose derivatives by time are here those of a flap frequency that varies.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wingfit.export.fmu.kernels import board as places
from wingfit.export.fmu.kernels.inputs import TURN, followed, turn_drive
from wingfit.records.array_types import Array
from wingfit.sim.kernels.jit import allocating
from wingfit.sim.vehicle import elements
from wingfit.sim.vehicle.elements import Constants, Side, wing_forces

# Numbers of a vehicle that do not change, in the array ``fixed``.
(
    THICKNESS, WIDTH, TWIST, TWIST_STEP, POINT, ROOT, DIHEDRAL_COSINE, DIHEDRAL_SINE, MIRRORED, PRINTED, CROSSED,
    PEEL_END, PEEL_WIDTH, CLAPS, PEELS, TOGETHER, SPEED_FACTOR, INCIDENCE_FACTOR, INCIDENCE_ZERO,
    PASSIVE, C0, C1, C2, C3, REST, PART, ZERO, INSTANTS,
    FIXED,
) = range(29)  # fmt: skip
WEIGHTS = 10  # of the rows of the elements and of the curves, then of rotation while the wings peel
ROTATION, PEEL = 2, 9
# Columns of the law of a weight: sign times value, limited, times a factor that is not negative.
VALUE, PER_HZ, PER_RAD, LOW, HIGH, FACTOR, FACTOR_PER_HZ, FACTOR_PER_RAD, SIGN, LAW = range(10)
_AT_ZERO = 1e-9  # beats: instants that count as the start of the beat


class Parts(NamedTuple):
    """Arrays of an exported vehicle. W is the number of lanes, all the same; E the number of elements of a wing.

    ``flap`` and ``pitch`` [K + 1, 2]: Fourier series of the flap angle, and of the angle that the pitch follows: that
    flap angle, late by the error of its phase, or the pitch itself. ``rates`` [2, n]: the first two derivatives of that
    angle by phase, at n instants. ``r`` [E], ``chord`` [1, E] (m), ``mass`` [1, E] (kg/m), ``density`` [1], ``carried``
    [1], ``loading`` [1, E]: as of :func:`wingfit.sim.vehicle.elements.wing_forces`. ``laws`` [WEIGHTS, LAW]. ``nodes``
    [3, M], with ``counts`` [3] used in each row, and ``barycentric`` [3, M]: nodes of flap frequency, airspeed and
    pitch, with their weights, between which ``table`` [M1, M2, M3, n, 2], a correction of the force (N), is
    interpolated. It is empty if there is none. ``rows`` and ``found``: scratch.
    """

    board: Array
    fixed: Array
    flap: Array
    pitch: Array
    rates: Array
    r: Array
    chord: Array
    mass: Array
    density: Array
    carried: Array
    loading: Array
    laws: Array
    nodes: Array
    barycentric: Array
    counts: Array
    table: Array
    rows: Array
    found: Array
    peel: Array  # flap frequency (Hz) for which the peel is known, its start and its end (beats)


@allocating
def _series_at(series: Array, phase: float, out: Array) -> None:
    """Set ``out`` [4] to a Fourier series [K + 1, 2] and its three derivatives by phase at ``phase``."""
    out[:] = 0.0
    dc, ds = math.cos(phase), math.sin(phase)
    c, s = 1.0, 0.0
    for k in range(len(series)):
        even = series[k, 0] * c - series[k, 1] * s
        odd = -(series[k, 0] * s + series[k, 1] * c)
        out[0] += even
        out[1] += k * odd
        out[2] -= k * k * even
        out[3] -= k * k * k * odd
        c, s = c * dc - s * ds, s * dc + c * ds


@allocating
def _by_time(p1: float, p2: float, p3: float, out: Array) -> None:
    """Turn the derivatives by phase in ``out`` [4] to those by time, p1... being those of the phase."""
    a1, a2, a3 = out[1], out[2], out[3]
    out[1], out[2] = a1 * p1, a2 * p1 * p1 + a1 * p2
    out[3] = a3 * p1**3 + 3.0 * a2 * p1 * p2 + a1 * p3


@allocating
def _pitch(fixed: Array, angle: Array, out: Array) -> None:
    """Set ``out`` [3] to the wing's pitch and two derivatives by time, from the ``angle`` [4] that it follows."""
    if fixed[PASSIVE] != 0.0:
        slope = fixed[C2] + 2.0 * fixed[C3] * angle[1]
        out[0] = fixed[C0] + fixed[C1] * angle[0] + (fixed[C2] + fixed[C3] * angle[1]) * angle[1]
        out[1] = fixed[C1] * angle[1] + slope * angle[2]
        out[2] = fixed[C1] * angle[2] + slope * angle[3] + 2.0 * fixed[C3] * angle[2] ** 2
    else:
        out[0], out[1], out[2] = angle[0], angle[1], angle[2]
    out[0] += fixed[PART] * (out[0] - fixed[REST]) + fixed[ZERO]
    out[1] += fixed[PART] * out[1]
    out[2] += fixed[PART] * out[2]


@allocating
def _find_peel(parts: Parts) -> None:
    """Find start and end of the peel, in beats, at the present flap frequency (``wingfit.sim.vehicle.motion._peel``).

    A start of 2 means that there is no peel, an end of 2 that it does not end.
    """
    fixed, peel, f = parts.fixed, parts.peel, parts.board[places.FLAPPING]
    if peel[0] == f:
        return
    n, start, end, before = parts.rates.shape[1], -1, 2.0, 0.0
    omega = TURN * f
    for k in range(n):
        rate = parts.rates[0, k] * omega
        if fixed[PASSIVE] != 0.0:
            slope = fixed[C2] + 2.0 * fixed[C3] * rate
            rate = fixed[C1] * rate + slope * parts.rates[1, k] * omega * omega
        rate *= 1.0 + fixed[PART]
        if start < 0 and rate < 0.0:
            start = k
        elif start >= 0 and rate >= 0.0:
            end = (k - rate / (rate - before)) / n
            break
        before = rate
    peel[0] = f
    peel[1] = start / n if start >= 0 and start / n < fixed[PEEL_END] else 2.0
    peel[2] = end


@allocating
def _peeling(parts: Parts, turn: float) -> float:
    """Return 1 while the wings peel apart and 0 after, ``turn`` being the time in beats from the start of a beat."""
    fixed, peel = parts.fixed, parts.peel
    if fixed[CLAPS] == 0.0:
        return 0.0
    _find_peel(parts)
    at_start = turn < _AT_ZERO or turn > 1.0 - _AT_ZERO
    at = 0.0 if at_start else turn
    if at < peel[1] - _AT_ZERO:
        return 0.0
    weight = 1.0
    if peel[2] < 2.0:
        width = max(fixed[PEEL_WIDTH], 1.0 / fixed[INSTANTS])
        x = min(max((peel[2] - at) / width + 0.5, 0.0), 1.0)
        weight = x * x * (3.0 - 2.0 * x)
    return 0.5 * weight if at_start else weight


@allocating
def _peeled(fixed: Array, turn: float) -> float:
    """Return the part of the chord that carries added mass."""
    if fixed[CLAPS] == 0.0 or fixed[TOGETHER] == 0.0:
        return 1.0
    apart = min(turn / fixed[PEEL_END], 1.0)
    if turn < _AT_ZERO or turn > 1.0 - _AT_ZERO:
        apart = math.sqrt(0.5)
    return apart + (1.0 - fixed[TOGETHER]) * (1.0 - apart)


@allocating
def _weight(law: Array, f: float, pitch: float) -> float:
    """Return the factor on the force of a row: a value that is limited, times a factor that is not negative."""
    value = min(max(law[VALUE] + law[PER_HZ] * f + law[PER_RAD] * pitch, law[LOW]), law[HIGH])
    factor = law[FACTOR] + law[FACTOR_PER_HZ] * f + law[FACTOR_PER_RAD] * pitch
    return law[SIGN] * value * max(factor, 0.0)


@allocating
def _correct(parts: Parts, turn: float, force: Array) -> None:
    """Add the correction by effects whose flow has a memory, that of a steady beat, to ``force`` [2]."""
    board, table = parts.board, parts.table
    if table.shape[3] == 0:
        return
    shares = np.zeros(parts.nodes.shape)
    inputs = board[places.FLAPPING], board[places.AIRSPEED], board[places.PITCH]
    for d in range(3):
        count = int(parts.counts[d])
        x = min(max(inputs[d], parts.nodes[d, 0]), parts.nodes[d, count - 1])
        total, hit = 0.0, -1
        for k in range(count):
            if x == parts.nodes[d, k]:
                hit = k
                break
            shares[d, k] = parts.barycentric[d, k] / (x - parts.nodes[d, k])
            total += shares[d, k]
        for k in range(count):
            shares[d, k] = (1.0 if k == hit else 0.0) if hit >= 0 else shares[d, k] / total
    n = table.shape[3]
    at = turn * n
    k = math.floor(at)
    x = at - k
    # cubic between the instants before and behind
    c0, c1 = -x * (x - 1.0) * (x - 2.0) / 6.0, (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0
    c2, c3 = -(x + 1.0) * x * (x - 2.0) / 2.0, (x + 1.0) * x * (x - 1.0) / 6.0
    before, here, later, last = (k - 1) % n, k % n, (k + 1) % n, (k + 2) % n
    for a in range(int(parts.counts[0])):
        for b in range(int(parts.counts[1])):
            for c in range(int(parts.counts[2])):
                share = shares[0, a] * shares[1, b] * shares[2, c]
                for i in range(2):
                    near = c0 * table[a, b, c, before, i] + c1 * table[a, b, c, here, i]
                    force[i] += share * (near + c2 * table[a, b, c, later, i] + c3 * table[a, b, c, last, i])


@allocating
def _fill(parts: Parts, flap: Array, pitch: Array, turn: float) -> None:
    """Set the motion of the wing, alike for both sides, in ``parts.rows`` (``wingfit.sim.vehicle.rows``)."""
    fixed, rows, board = parts.fixed, parts.rows, parts.board
    half = fixed[TWIST] * (pitch[0] - fixed[ROOT])
    c, s = math.cos(half), math.sin(half)
    incidence = board[places.PITCH] * fixed[INCIDENCE_FACTOR] + fixed[INCIDENCE_ZERO]
    values = np.zeros(14)
    values[elements.FLAP_RATE], values[elements.FLAP_ACCELERATION] = flap[1], flap[2]
    values[elements.PITCH_RATE], values[elements.PITCH_ACCELERATION] = pitch[1], pitch[2]
    values[elements.PEELED] = _peeled(fixed, turn)
    values[elements.COSINE] = math.cos(fixed[ROOT]) * c - math.sin(fixed[ROOT]) * s
    values[elements.SINE] = math.sin(fixed[ROOT]) * c + math.cos(fixed[ROOT]) * s
    values[elements.STEP_COSINE], values[elements.STEP_SINE] = c * c - s * s, 2.0 * c * s
    values[elements.FORWARD] = board[places.AIRSPEED] * fixed[SPEED_FACTOR] * math.cos(incidence)
    values[elements.DOWNWARD] = board[places.AIRSPEED] * fixed[SPEED_FACTOR] * math.sin(incidence)
    for k in range(14):
        rows[0, k, 0, :] = values[k]


@allocating
def _side(parts: Parts, flap: Array, upper: bool) -> Side:
    """Set dihedral and stream of lower or upper wings in ``parts.rows``, and return the factors of this side."""
    fixed, rows = parts.fixed, parts.rows
    sign, printed = -1.0 if upper else 1.0, fixed[PRINTED]
    c, s, cosine, sine = fixed[DIHEDRAL_COSINE], fixed[DIHEDRAL_SINE], math.cos(flap[0]), math.sin(flap[0])
    dihedral = c * cosine + sign * s * sine
    rows[0, elements.DIHEDRAL, 0, :] = dihedral
    rows[0, elements.DIHEDRAL_RATE, 0, :] = (sign * s * cosine - c * sine) * flap[1]
    rows[0, elements.PROJECTION, 0, :] = cosine if printed != 0.0 else dihedral
    if upper:
        rows[0, elements.DOWNWARD, 0, :] *= -1.0
    return Side(-1.0 if printed != 0.0 and upper else 1.0, printed, sign)


@allocating
def observe(parts: Parts) -> None:
    """Set the outputs on the board to those of now."""
    board, fixed = parts.board, parts.fixed
    time, turn = board[places.SMOOTHING], board[places.PHASE] / TURN
    f, f1, f2, _, _ = followed(board[places.FLAPPING], board[places.FLAPPING_RATE], board[places.FREQUENCY], time, 0.0)
    flap, angle, pitch = np.zeros(4), np.zeros(4), np.zeros(3)
    _series_at(parts.flap, board[places.PHASE], flap)
    _by_time(TURN * f, TURN * f1, TURN * f2, flap)
    _series_at(parts.pitch, board[places.PHASE], angle)
    _by_time(TURN * f, TURN * f1, TURN * f2, angle)
    _pitch(fixed, angle, pitch)
    _fill(parts, flap, pitch, turn)
    parts.found[:] = 0.0
    constants = Constants(fixed[THICKNESS], fixed[WIDTH], fixed[TWIST], fixed[TWIST_STEP], fixed[POINT])
    for k in range(2 if fixed[CROSSED] != 0.0 else 1):
        side = _side(parts, flap, k == 1)
        wing_forces(
            parts.rows, side, parts.r, parts.chord, parts.mass, parts.density, parts.carried, parts.loading, constants,
            parts.found,
        )  # fmt: skip
    peel = _peeling(parts, turn)
    force = np.zeros(2)
    for k in range(WEIGHTS):
        row = ROTATION if k == PEEL else k
        if row >= parts.found.shape[1]:
            continue
        weight = _weight(parts.laws[k], f, board[places.PITCH])
        if k == ROTATION:
            weight *= 1.0 - peel * fixed[PEELS]
        elif k == PEEL:
            weight *= peel
        for i in range(2):
            force[i] += weight * fixed[MIRRORED] * parts.found[0, row, i, 0, 0]
    _correct(parts, turn, force)
    sine, cosine = math.sin(board[places.PITCH]), math.cos(board[places.PITCH])
    board[places.FORCE], board[places.FORCE + 2] = force[0], force[1]
    board[places.LIFT], board[places.DRAG] = force[0] * sine - force[1] * cosine, -force[0] * cosine - force[1] * sine
    board[places.FRONT_ANGLE], board[places.WING_PITCH], board[places.TURN] = flap[0], pitch[0], turn


@allocating
def run_vehicle(parts: Parts, dt: float) -> int:
    """Advance the drive by ``dt`` seconds, exactly, and set the outputs: the forces have no memory of their own.

    At ``dt`` = 0 the drive takes the flap frequency of the input instead.
    """
    if dt > 0.0:
        turn_drive(parts.board, dt)
    else:
        parts.board[places.FLAPPING] = parts.board[places.FREQUENCY]
    observe(parts)
    return places.FINE
