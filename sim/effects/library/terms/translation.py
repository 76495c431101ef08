"""Effect: circulation of a wing by its angle of attack, in a model that leaves it out."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.include("translation", values["coefficient"], "C_l")


EFFECT = effect_of_air(
    name="translation",
    title="Circulation of translation",
    size=(Parameter("coefficient", "1", 0.0, 5.0, 1.2, "coefficient of lift, C_L = coefficient sin 2 alpha"),),
    law="Gamma' = Gamma + (coefficient / 2) c V sin 2 alpha",
    source="Armanini et al. (2016), Eqs. 2, 3 and 8; Dickinson, Lehmann and Sane (1999): lift of a revolving wing",
    signature="the force across the flow in the middle of both half strokes",
    confused_with=("varying_coefficients", "residual_air"),
    term="translation",
    vehicle=_vehicle,
)
