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
    slender = values["slender"][:, None]
    for axis, part in enumerate((np.cos(angle), np.sin(angle))):
        scene.added[:, axis] -= drag * part * (1.0 - slender + slender * np.abs(part))


EFFECT = effect_of_air(
    name="body_drag",
    title="Drag of body and tail",
    size=(Parameter("area", "1", 0.0, 2.0, 0.2, "drag area C_D A of body and tail, over the area of one wing"),),
    shape=(
        Parameter(
            "slender", "1", 0.0, 1.0, 0.0,
            "how the force turns with the body pitch: 0: along the stream, as of a sphere; 1: the components of the "
            "stream along and across the body act independently, as on a slender body",
        ),
    ),
    law="(X, Z)' = (X, Z) - area (rho / 2) V^2 S (f(cos alpha), f(sin alpha))\n"
    "f(u) = u (1 - slender + slender |u|)",
    source="Hoerner (1965), Fluid-Dynamic Drag, ch. 3 and 13: drag of bodies, in proportion to the dynamic pressure; "
    "Allen and Perkins (1951), NACA Report 1048: axial drag and cross-flow of a slender body; "
    "Armanini et al. (2016), section 2.2: the model has forces of the wings only",
    signature="a constant force against the stream, which grows with the square of the airspeed",
    confused_with=("balance_offset", "tail_lift", "airspeed_error"),
    vehicle=_vehicle,
)  # fmt: skip
