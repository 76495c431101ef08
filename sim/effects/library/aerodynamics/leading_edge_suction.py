"""Effect: the suction at the leading edge is smaller than that of attached flow, or larger."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred


def _suction(scene: VehicleScene, values: Values) -> None:
    """Change the force of the circulation along the chord, that due to pitching excepted, by a factor."""
    flow = scene.flow
    lifting = flow.circulation - scene.wings.rotation
    scene.push_along_chord(-(values["change"] * scene.density)[:, None, None] * lifting * flow.normal)


EFFECT = effect_of_air(
    name="leading_edge_suction",
    title="Leading-edge suction",
    size=(
        Parameter(
            "change", "1", -1.0, 1.0, -0.3, "relative change of the suction at the leading edge; -1: there is none"
        ),
    ),
    law="F_chord' = F_chord + change rho Gamma_alpha V sin alpha, towards the leading edge",
    source="Garrick (1936), NACA Report 567: thrust of a flapping wing as leading-edge suction; DeLaurier (1993), "
    "Aeronautical Journal 97, 125: leading-edge suction efficiency of a flapping wing; Polhamus (1966), NASA TN "
    "D-3767: without suction the force is normal to a thin wing",
    signature="a force along the chord, in the same direction in both half strokes, that grows with the square of the "
    "normal velocity, and no change of the force normal to the wing",
    confused_with=("downwash", "viscous_drag", "lift_curve"),
    vehicle=deferred("circulation", _suction),
)
