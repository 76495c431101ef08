"""Effect: the axis about which the drive turns the rods is displaced from the one described in the dataset."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    offset = np.stack([np.zeros_like(values["y"]), values["y"], values["z"]])
    scene.lanes.hinge[3:6] += offset
    scene.lanes.hinge[6:9] += offset


EFFECT = effect_of_drive(
    name="hinge_offset",
    title="Hinge offset",
    size=tuple(
        Parameter(axis, "m", -0.4, 0.4, 0.03, f"distance of the true axis {where} the described one", of="chord")
        for axis, where in (("y", "outboard of"), ("z", "above"))
    ),
    law="s = s_described + (0, y, z),     p' = s + R (p - s)",
    source="Euler (1776) and Goldstein (1950), Classical Mechanics, sect. 4-6: rotation about a displaced axis; van "
    "der Grinten, The bird is the word, names the distance between axis and wing as a likely cause of an error of 2 "
    "cm",
    signature="at any one phase all markers are off by the same vector, which turns with the flap angle and is zero at "
    "flap angle zero, in every condition",
    confused_with=("stroke_amplitude", "camera_shift", "hinge_tilt"),
    wing=_wing,
)
