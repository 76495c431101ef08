"""Fault of the description: the body pitch is measured from another zero."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.incidence = scene.incidence + values["angle"]


EFFECT = effect_of_air(
    name="body_pitch_error",
    title="Body pitch error",
    size=(Parameter("angle", "rad", -0.5, 0.5, 0.05, "angle added to the body pitch"),),
    law="alpha' = alpha + angle",
    source="Armanini et al. (2016), Table 4 and Eqs. 18 and 19: the body pitch gives the direction of the stream",
    signature="mean forces change with the direction of the stream, most in a fast stream and least in hover",
    confused_with=("balance_tilt", "airspeed_error", "tail_lift", "wing_pitch_zero", "zero_lift_angle"),
    vehicle=_vehicle,
)
