"""The mean flap angle differs from the described one."""

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
    source="mean flap angle, eta of Armanini et al. (2016), Eqs. 20-21",
    signature="a constant rotation of the wing about its flapping axis; in forces, the wing pitch that follows the "
    "stroke",
    confused_with=("camera_rotation", "balance_tilt"),
    wing=_wing,
    vehicle=_vehicle,
)
