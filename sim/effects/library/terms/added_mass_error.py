"""Effect: a wing accelerates more air than the model's added mass, which is that of a rigid plate far from others."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.carried = scene.carried * (1.0 + values["part"])


EFFECT = Effect(
    name="added_mass_error",
    title="Error of added mass",
    family="aerodynamics",
    port="inertia",
    size=(Parameter("part", "1", -0.6, 1.2, 0.2, "relative error of added mass; positive if more air is accelerated"),),
    law="m_22' = (1 + part) pi rho c^2 / 4",
    source="Sedov (1965), Two-Dimensional Problems in Hydrodynamics and Aerodynamics: plates near each other and near "
    "walls; Armanini et al. (2016), Eq. 10",
    signature="a force in phase with the acceleration of the wing, in proportion to the density of the air",
    confused_with=("mass_offset", "clock_offset", "drive_harmonics", "scale_error", "residual_air", "wing_mass_error"),
    of_term="added_mass",
    vehicle=_vehicle,
)
