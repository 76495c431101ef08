"""Effect: the force that accelerates the mass of the wing."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.include("wing_acceleration", values["share"])


EFFECT = Effect(
    name="wing_acceleration",
    title="Acceleration of the wing's mass",
    family="inertia",
    port="inertia",
    size=(Parameter("share", "1", 0.0, 3.0, 1.0, "accelerated mass over the described mass of the wing"),),
    law="F' = F - share m_w a",
    source="Newton (1687), second law; Armanini et al. (2016), Eqs. 12 to 14 have the part of it with theta_w' only",
    signature="a force in phase with the acceleration of the flap angle, with mean zero, in vacuum as in air",
    confused_with=("inertial", "added_mass_error", "mass_offset"),
    term="wing_acceleration",
    vehicle=_vehicle,
)
