"""How flap frequency and phase lag follow the inputs of an FMU, which may jump.

A jump of the flap frequency would be an infinite acceleration of the wing. The frequency f of the drive therefore
follows the input u as a critically damped second-order system, f'' = (u - f) / T^2 - 2 f' / T, whose solution within a
step is known in closed form. The phase of the drive is the integral of f.
"""

from __future__ import annotations

import math

from wingfit.export.fmu.kernels import board as places
from wingfit.records.array_types import Array
from wingfit.sim.kernels.jit import allocating, inlined

TURN = 2.0 * math.pi
Followed = tuple[float, float, float, float, float]


@inlined
def followed(value: float, rate: float, target: float, time: float, t: float) -> Followed:
    """Return value, its first three derivatives, and its integral, ``t`` seconds after ``value`` and ``rate``.

    ``target`` is constant in between; ``time`` (s) is T; at zero the value is the target at once.
    """
    if time <= 0.0:
        return target, 0.0, 0.0, 0.0, target * t
    apart, pace = value - target, 1.0 / time
    slope = rate + apart * pace
    left = math.exp(-t * pace)
    e = (apart + slope * t) * left
    e1 = slope * left - e * pace
    e2 = -pace * (2.0 * e1 + e * pace)
    e3 = -pace * (2.0 * e2 + e1 * pace)
    past = time * (apart * (1.0 - left) + slope * (time * (1.0 - left) - t * left))
    return target + e, e1, e2, e3, target * t + past


@allocating
def turn_drive(board: Array, t: float) -> None:
    """Advance the drive by ``t`` seconds: phase, flap frequency and phase lag."""
    time = board[places.SMOOTHING]
    f, f1, _, _, turned = followed(
        board[places.FLAPPING], board[places.FLAPPING_RATE], board[places.FREQUENCY], time, t
    )
    lag, l1, _, _, _ = followed(board[places.LAGGING], board[places.LAGGING_RATE], board[places.LAG], time, t)
    board[places.FLAPPING], board[places.FLAPPING_RATE] = f, f1
    board[places.LAGGING], board[places.LAGGING_RATE] = lag, l1
    board[places.PHASE] += TURN * turned
    while board[places.PHASE] >= TURN:
        board[places.PHASE] -= TURN
        board[places.BEATS] += 1.0
    board[places.TURN] = board[places.PHASE] / TURN
