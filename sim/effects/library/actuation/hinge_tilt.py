"""The axis about which the drive turns the rods does not point along the body."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    tilt = Rotation.from_rotvec(np.stack([np.zeros_like(values["y"]), values["y"], values["z"]], axis=1))
    axes = scene.lanes.hinge[:3].T  # as effects before have them
    scene.lanes.hinge[:3] = tilt.apply(axes).T


EFFECT = Effect(
    name="hinge_tilt",
    title="Hinge tilt",
    family="actuation",
    port="drive",
    size=tuple(
        Parameter(
            axis, "rad", -0.2, 0.2, 0.03, f"component along {axis} of the rotation from the axis told to the true"
        )
        for axis in "yz"
    ),
    source="rotation about a tilted axis by the formula of Rodrigues (1840); the tilt itself is the rotation vector "
    "(0, y, z)",
    signature="the wing sweeps fore and aft, or twists, in proportion to the flap angle, slow or fast, with or without "
    "air",
    confused_with=("camera_rotation", "hinge_offset", "phase_lag_error"),
    wing=_wing,
)
