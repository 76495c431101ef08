"""Effect: the wing's pitch is described with a wrong zero."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.pitch = scene.pitch._replace(zero=values["angle"])


EFFECT = effect_of_drive(
    name="wing_pitch_zero",
    title="Wing pitch zero error",
    size=(
        Parameter(
            "angle", "rad", -0.4, 0.4, 0.05, "angle added to the wing pitch at the pitch station, at every phase"
        ),
    ),
    law="theta_w'(t) = theta_w(t) + angle",
    source="Armanini et al. (2016), Eq. 17: the constant of the wing pitch, called C_theta0 there",
    signature="the force is rotated and changes with the angle of attack of both half strokes, in opposite directions",
    confused_with=("zero_lift_angle", "stroke_bias", "balance_tilt"),
    vehicle=_vehicle,
)
