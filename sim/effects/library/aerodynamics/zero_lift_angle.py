"""Effect: a cambered wing has no lift at an angle of attack that is not zero."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred


def _camber(scene: VehicleScene, values: Values) -> None:
    """Let the circulation depend on the angle of attack less ``angle``; its force stays across the flow.

    Lift of a lower or single wing is positive against body z; upper wings are mirrored.
    """
    flow, angle = scene.flow, values["angle"][:, None, None]
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = flow.along * cosine - flow.normal * sine, flow.normal * cosine + flow.along * sine
    flow.circulation += scene.wings.circulation(*turned)[1] - scene.wings.circulation(flow.along, flow.normal)[1]


EFFECT = effect_of_air(
    name="zero_lift_angle",
    title="Zero-lift angle of a cambered wing",
    size=(Parameter("angle", "rad", -0.3, 0.3, 0.05, "angle of attack at which the wing has no lift"),),
    law="Gamma' = Gamma(alpha - angle)",
    source="Munk (1922), NACA Report 142: zero-lift angle of a cambered section; Anderson (2017), Fundamentals of "
    "Aerodynamics, section 4.8",
    signature="lift grows in one half stroke and falls in the other",
    confused_with=("wing_pitch_zero", "stroke_bias"),
    vehicle=deferred("circulation", _camber),
)
