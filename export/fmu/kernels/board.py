"""Places of the numbers that an importer sees or that steer a simulation, in the array called the board."""

from __future__ import annotations

(
    FREQUENCY, LAG, AIRSPEED, PITCH,  # inputs: Hz, rad, m/s, rad
    EXTRAPOLATE, SMOOTHING, STEPS, RAMP,  # parameters: 0 or 1, s, steps per beat, beats
    PHASE, BEATS,  # phase of the drive, rad from 0 to 2 pi, and the number of completed beats
    FLAPPING, FLAPPING_RATE,  # flap frequency that follows the input (Hz), and its rate
    LAGGING, LAGGING_RATE,  # the same of the phase lag (rad)
    LEAST,  # Hz: below this frequency the steps of time do not grow
    TURN,  # part of the beat, from 0 to 1
    FORCE, _FORCE_Y, _FORCE_Z, MOMENT, _MOMENT_Y, _MOMENT_Z, AIR, _AIR_Y, _AIR_Z,  # N and N m
    LIFT, DRAG,  # N
    FRONT_TORQUE, REAR_TORQUE, POWER,  # N m, W
    FRONT_ANGLE, REAR_ANGLE, WING_PITCH,  # rad
    BOARD,
) = range(34)  # fmt: skip

FINE, DIVERGED = 0, 1  # results of an advance in time
