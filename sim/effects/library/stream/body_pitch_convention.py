"""Fault of the description: the body pitch has the wrong sign, or is in degrees instead of radians."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.incidence = scene.incidence * (1.0 + values["part"])


EFFECT = effect_of_air(
    name="body_pitch_convention",
    title="Wrong sign or unit of the body pitch",
    size=(
        Parameter(
            "part", "1", -2.0, 60.0, 56.3, "-2: wrong sign, 56.3: degrees instead of radians", positions=(-2.0, 56.3)
        ),
    ),
    law="alpha' = (1 + part) alpha",
    source="Armanini et al. (2016), Table 4 and Eqs. 18 and 19: the body pitch gives the direction of the stream",
    signature="mean forces change with the direction of the stream, most in a fast stream and least in hover",
    confused_with=("axis_sign",),
    vehicle=_vehicle,
)
