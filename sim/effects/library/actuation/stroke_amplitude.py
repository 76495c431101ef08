"""Effect: the stroke amplitude is larger than described in the dataset."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.flap[:, 1:] *= (1.0 + values["part"])[:, None]


def _wing(scene: WingScene, values: Values) -> None:
    scene.rods.series[1:] *= 1.0 + values["part"]


EFFECT = effect_of_drive(
    name="stroke_amplitude",
    title="Stroke amplitude error",
    size=(
        Parameter(
            "part", "1", -0.4, 0.4, 0.05, "relative error of the stroke; positive if it is larger than described"
        ),
    ),
    law="zeta(t) = zeta_0 + (1 + part) sum_{k > 0} Re zeta_k exp(2 pi i k t*)",
    source="Armanini et al. (2016), Eqs. 17, 20 and 21: the flap angle, and the wing pitch that follows it and is "
    "scaled too",
    signature="displacements grow in proportion to the stroke and forces with its square, and their shape over the "
    "beat hardly changes",
    confused_with=("scale_error", "residual_air"),
    wing=_wing,
    vehicle=_vehicle,
)
