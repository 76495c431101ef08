"""Effect: only the part of the chord that has come apart from the other wing carries added mass."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.together = scene.together + values["share"]


EFFECT = Effect(
    name="effective_chord",
    title="Effective chord of peeling wings",
    family="aerodynamics",
    port="inertia",
    size=(
        Parameter("share", "1", 0.0, 1.0, 1.0, "part of the chord that has not come apart and carries no added mass"),
    ),
    law="c_eff = c (1 - share (1 - min(t* / t*_peel, 1)))",
    source="Armanini et al. (2016), below Eqs. 10 and 19",
    signature="the force by added mass is smaller at the start of the beat, while the wings peel",
    confused_with=("clap_and_peel", "added_mass_error"),
    term="effective_chord",
    vehicle=_vehicle,
)
