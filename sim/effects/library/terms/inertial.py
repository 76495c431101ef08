"""Effect: forces by the inertia of a wing that turns, in a model that leaves them out."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.include("inertial", values["share"])


EFFECT = Effect(
    name="inertial",
    title="Inertia of the turning wing",
    family="inertia",
    port="inertia",
    size=(
        Parameter(
            "share", "1", 0.0, 3.0, 1.0, "these forces over those by the described mass of the wing and its added mass"
        ),
    ),
    law="(F_c, F_n)' = (F_c, F_n) + share ((m_w + m_22) v_n theta', -(m_w + m_11) v_c theta')",
    source="Armanini et al. (2016), Eqs. 12 to 14, the terms with theta_w'",
    signature="a force while the wing pitches and moves, in vacuum as in air, except for the added mass",
    confused_with=("wing_acceleration", "mass_offset", "added_mass"),
    term="inertial",
    vehicle=_vehicle,
)
