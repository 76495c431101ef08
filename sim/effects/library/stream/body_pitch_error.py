"""Fault of the description: the body pitch has the wrong sign, another zero, or is in degrees instead of radians."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.incidence = scene.incidence * (1.0 + values["part"]) + values["angle"]


EFFECT = effect_of_air(
    name="body_pitch_error",
    title="Body pitch error",
    size=(
        Parameter("angle", "rad", -0.5, 0.5, 0.05, "angle added to the body pitch"),
        Parameter(
            "part", "1", -2.0, 60.0, 56.3, "-2: wrong sign, 56.3: degrees instead of radians", positions=(-2.0, 56.3)
        ),
    ),
    law="alpha' = (1 + part) alpha + angle",
    source="Armanini et al. (2016), Table 4 and Eqs. 18 and 19: the body pitch gives the direction of the stream",
    signature="mean forces change with the direction of the stream, most in a fast stream and least in hover",
    confused_with=("axis_sign", "balance_tilt", "airspeed_error", "tail_lift"),
    vehicle=_vehicle,
)
