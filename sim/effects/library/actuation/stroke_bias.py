"""Effect: the mean flap angle differs from the one described in the dataset."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.flap[:, 0] += values["angle"]


def _wing(scene: WingScene, values: Values) -> None:
    scene.rods.series[0] += values["angle"]


EFFECT = effect_of_drive(
    name="stroke_bias",
    title="Stroke bias",
    size=(Parameter("angle", "rad", -0.2, 0.2, 0.03, "angle added to the flap angle at every phase"),),
    law="zeta(t) = zeta_0 + angle + sum_{k > 0} Re zeta_k exp(2 pi i k t*)",
    source="Armanini et al. (2016), Eqs. 20 and 21: the mean flap angle, called eta there",
    signature="the whole wing is rotated by a constant angle about its flapping axis, and forces change with the wing "
    "pitch, which follows the stroke",
    confused_with=("camera_rotation", "balance_tilt", "wing_pitch_zero"),
    wing=_wing,
    vehicle=_vehicle,
)
