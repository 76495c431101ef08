"""Effect: the wings have another mass than described."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.mass_factor = scene.mass_factor * (1.0 + values["part"])


EFFECT = Effect(
    name="wing_mass_error",
    title="Error of the wings' mass",
    family="inertia",
    port="inertia",
    size=(Parameter("part", "1", -0.6, 1.2, 0.2, "relative error of the mass; positive if the wings are heavier"),),
    law="m_w' = (1 + part) m_w",
    source="Armanini et al. (2016), Eqs. 12 to 14, the terms with m_w",
    signature="a force in phase with the acceleration of the wing and with its pitch rate, in vacuum as in air",
    confused_with=("added_mass_error", "mass_offset", "scale_error", "wing_acceleration"),
    of_term="inertial",
    vehicle=_vehicle,
)
