"""Effect: the stream drags on the vehicle's body and tail."""

from __future__ import annotations

import numpy as np

from wingfit.records import Vehicle
from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_air, measure
from wingfit.sim.effects.ports.vehicle import VehicleScene


def wing_area(vehicle: Vehicle) -> float:
    """Return the area (m^2) of one wing of ``vehicle``."""
    return measure(vehicle, "chord") * vehicle.span


def stream_force(scene: VehicleScene) -> Array:
    """Return (rho / 2) V^2 S [B] (N) of the stream at the vehicle, S being the area of one wing."""
    return np.asarray(0.5 * scene.density * scene.airspeed**2 * wing_area(scene.setting.vehicle))


def _vehicle(scene: VehicleScene, values: Values) -> None:
    angle = scene.incidence[:, None]
    drag = (values["area"] * stream_force(scene))[:, None]
    scene.added[:, 0] -= drag * np.cos(angle)
    scene.added[:, 1] -= drag * np.sin(angle)


EFFECT = effect_of_air(
    name="body_drag",
    title="Drag of body and tail",
    size=(Parameter("area", "1", 0.0, 2.0, 0.2, "drag area C_D A of body and tail, over the area of one wing"),),
    law="(X, Z)' = (X, Z) - area (rho / 2) V^2 S (cos alpha, sin alpha)",
    source="Hoerner (1965), Fluid-Dynamic Drag, ch. 3 and 13: drag of bodies, in proportion to the dynamic pressure; "
    "Armanini et al. (2016), section 2.2: the model has forces of the wings only",
    signature="a constant force against the stream, which grows with the square of the airspeed",
    confused_with=("balance_offset", "tail_lift", "airspeed_error"),
    vehicle=_vehicle,
)
