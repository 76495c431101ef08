"""Effect: the lift of a wing of finite span deflects the air that it meets, which tilts its force backward."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.vehicle.rows import mirrored

_ROUNDS = 12  # halves the error each time at least: the downwash is a small part of the flow


def _deflect(scene: VehicleScene, values: Values) -> None:
    """Move the air at each station by w = share Gamma / (2 b) against the lift; Gamma is that in the moved air.

    b is the span of the wings that carry one vortex system: both of a pair, or a single wing.
    """
    flow, wings = scene.flow, scene.wings
    span = scene.span * mirrored(scene.setting.vehicle)
    per = (values["share"] / (2.0 * span))[:, None, None]
    x, z = flow.along / flow.speed, flow.normal / flow.speed
    _, start = wings.circulation(flow.along, flow.normal)
    more, w = flow.circulation - start, per * flow.circulation
    for _ in range(_ROUNDS):
        _, found = wings.circulation(flow.along - w * z, flow.normal + w * x)
        w = 0.5 * (w + per * (found + more))
    flow.along, flow.normal = flow.along - w * z, flow.normal + w * x
    flow.speed, found = wings.circulation(flow.along, flow.normal)
    flow.circulation = found + more


EFFECT = effect_of_air(
    name="downwash",
    title="Downwash and induced drag",
    size=(
        Parameter("share", "1", 0.0, 4.0, 1.0, "downwash over that of a wing with elliptic lift in a steady stream"),
    ),
    law="w = share Gamma / (2 b), against the lift\nGamma = Gamma_0(V - w)",
    source="Prandtl (1918), Tragfluegeltheorie; Glauert (1926), The Elements of Aerofoil and Airscrew Theory, ch. XI: "
    "induced drag of a wing of finite span",
    signature="drag grows with the square of the lift, and lift is smaller",
    confused_with=("induced_inflow", "tip_loss", "varying_coefficients"),
    vehicle=deferred("circulation", _deflect),
)
