"""Effect: a drive whose speed drops under load, so that the rods are late where the wing needs power."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.motor import AVERAGING, DROOP, FOLLOWING, HOLDING, MOTOR

# Rates over the angular rate of the beat. Leads and errors of the mean load decay to e^(-2 pi) within a beat. Slower
# rates would react less to the load within the beat, but need a third more beats to the periodic motion.
GOVERNOR = 1.0
LEARNING = 1.0


def _wing(scene: WingScene, values: Values) -> None:
    """Drive the crank by a motor with the time constant t, whose governor demands a relative change of speed.

    The change is -d (P - P_m) - g tau, where P is the load, P_m its mean, tau the lead of the crank
    in s, and g the gain ``GOVERNOR`` times the angular rate of the beat.
    """
    motor = np.zeros((MOTOR, LANES))
    motor[DROOP], motor[FOLLOWING] = values["d"], 1.0 / values["t"]
    motor[HOLDING] = GOVERNOR * scene.angular_rate / values["t"]
    motor[AVERAGING] = LEARNING * scene.angular_rate
    scene.motor = motor


_TEXT = "relative loss of motor speed per watt of load, for loads that vary much faster than the beat"

EFFECT = effect_of_drive(
    name="compliant_drive",
    title="Compliant drive",
    size=(Parameter("d", "1/W", 0.0, 0.02, 0.005, _TEXT),),
    shape=(Parameter("t", "s", 0.01, 0.2, 0.04, "time constant of the motor's response to its load", scale="log"),),
    memory="the lead of the crank, its speed error, and the mean load",
    law="tau' = sigma\nsigma' = -(d (P - P_m) + sigma) / t - (2 pi f / t) tau\nP_m' = 2 pi f (P - P_m)",
    source="Hughes (1990), Electric Motors and Drives, ch. 3: speed over torque of a direct-current motor, and its "
    "mechanical time constant; Maxwell (1868), On Governors: control of the mean speed",
    signature="the stroke falls behind in each of the two phases of heavy load in a beat and catches up between them, "
    "and this change grows with flap frequency and air density",
    confused_with=("drive_harmonics", "phase_lag_error"),
    wing=_wing,
)
