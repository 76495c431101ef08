"""Effect: body and tail of the vehicle have lift."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.library.stream.body_drag import stream_force
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    angle = scene.incidence[:, None]
    coefficient = values["constant"][:, None] + values["slope"][:, None] * np.sin(angle)
    lift = coefficient * stream_force(scene)[:, None]
    scene.added[:, 0] += lift * np.sin(angle)
    scene.added[:, 1] -= lift * np.cos(angle)


EFFECT = effect_of_air(
    name="tail_lift",
    title="Lift of body and tail",
    size=(
        Parameter(
            "constant", "1", -2.0, 2.0, 0.1, "lift area of body and tail at no body pitch, over that of one wing"
        ),
        Parameter("slope", "1", 0.0, 6.0, 0.3, "increase of this ratio with the sine of the body pitch"),
    ),
    law="(X, Z)' = (X, Z) + (constant + slope sin alpha) (rho / 2) V^2 S (sin alpha, -cos alpha)",
    source="Hoerner and Borst (1975), Fluid-Dynamic Lift, ch. 3 and 19: lift of wings of small aspect ratio and of "
    "bodies; Armanini et al. (2016), Eq. 16: axes of lift and drag",
    signature="a constant force across the stream, which grows with the square of the airspeed",
    confused_with=("body_drag", "balance_offset"),
    vehicle=_vehicle,
)
