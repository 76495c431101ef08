"""Effect: the wing's pitch varies more over the beat than described in the dataset."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.pitch = scene.pitch._replace(part=values["part"])


EFFECT = effect_of_drive(
    name="wing_pitch_amplitude",
    title="Wing pitch amplitude error",
    size=(
        Parameter(
            "part", "1", -0.6, 0.6, 0.1, "relative error of the wing pitch less theta_0; positive if it varies more"
        ),
    ),
    law="theta_w'(t) = theta_0 + (1 + part) (theta_w(t) - theta_0)",
    source="Armanini et al. (2016), Eq. 17: a flexible wing pitches in proportion to its flap angle and flap rate",
    signature="the wing meets the air at smaller angles in the middle of each stroke, and the forces by its pitch "
    "rate grow",
    confused_with=("stroke_amplitude", "varying_coefficients"),
    vehicle=_vehicle,
)
