"""Effect: the wings are longer or shorter than described."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    longer = 1.0 + values["part"]
    scene.length, scene.mass_factor = scene.length * longer, scene.mass_factor / longer


EFFECT = effect_of_air(
    name="wing_length_error",
    title="Error of the wings' length",
    size=(Parameter("part", "1", -0.4, 0.4, 0.05, "relative error of the length; positive if the wings are longer"),),
    law="r' = (1 + part) r",
    source="Armanini et al. (2016), Eqs. 1 and 18: the sum over the elements, and their velocity by flapping",
    signature="forces by flapping grow with the square of the length and more, those by the stream in proportion",
    confused_with=("stroke_amplitude", "airspeed_error", "scale_error"),
    vehicle=_vehicle,
)
