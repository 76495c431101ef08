"""Effect: the axis about which the drive turns the rods is not parallel to the body's x axis."""

from __future__ import annotations

import numpy as np
import scipy

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.wing import WingScene

_FROM_TO = "from the described axis to the true one"


def _wing(scene: WingScene, values: Values) -> None:
    tilt = scipy.spatial.transform.Rotation.from_rotvec(
        np.stack([np.zeros_like(values["y"]), values["y"], values["z"]], axis=1)
    )
    axes = scene.lanes.hinge[:3].T  # as effects before have them
    scene.lanes.hinge[:3] = tilt.apply(axes).T


EFFECT = effect_of_drive(
    name="hinge_tilt",
    title="Hinge tilt",
    size=tuple(
        Parameter(axis, "rad", -0.2, 0.2, 0.03, f"{axis} component of the rotation vector {_FROM_TO}") for axis in "yz"
    ),
    law="u = R(0, y, z) e_x,     R_rod = cos phi I + sin phi u~ + (1 - cos phi) u u^T",
    source="Rodrigues (1840): rotation about an axis, here one that is tilted by the rotation vector (0, y, z)",
    signature="the wing sweeps fore and aft, or twists, in proportion to the flap angle, at any flap frequency, with "
    "or without air",
    confused_with=("camera_rotation", "hinge_offset", "phase_lag_error"),
    wing=_wing,
)
