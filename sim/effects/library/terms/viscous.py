"""Effect: friction and pressure drag of a vehicle's wing, in a model that leaves them out."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.include("viscous_0", values["friction"], "C_D0")
    scene.include("viscous_90", values["pressure"], "C_Dpi2")


EFFECT = effect_of_air(
    name="viscous",
    title="Friction and pressure drag of the wing",
    size=(
        Parameter("friction", "1", 0.0, 1.0, 0.1, "drag coefficient at zero angle of attack"),
        Parameter("pressure", "1", 0.0, 5.0, 2.0, "drag coefficient at 90 degrees angle of attack"),
    ),
    law="F' = F - (rho / 2) c (friction cos^2 alpha + pressure sin^2 alpha) |V| V",
    source="Armanini et al. (2016), Eq. 11; Berman and Wang (2007)",
    signature="a force against the motion of the wing, largest in the middle of both half strokes",
    confused_with=("translation", "residual_air", "downwash"),
    term="viscous",
    vehicle=_vehicle,
)
