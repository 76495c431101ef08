"""Effect: the wings are broader or narrower than described."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.chord = scene.chord * (1.0 + values["part"])


EFFECT = effect_of_air(
    name="wing_chord_error",
    title="Error of the wings' chord",
    size=(Parameter("part", "1", -0.6, 1.5, 0.1, "relative error of the chord; positive if the wings are broader"),),
    law="c' = (1 + part) c",
    source="Armanini et al. (2016), Eqs. 2, 3, 10 and 11",
    signature="forces by pitching and by acceleration grow with the square of the chord, all others in proportion",
    confused_with=("added_mass_error", "residual_air", "scale_error"),
    vehicle=_vehicle,
)
