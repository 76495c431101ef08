"""Effect: the flow separates late, and the vortex that it sheds carries the lost lift until it leaves the wing."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.library.aerodynamics.dynamic_stall import SEPARATION, attached_fraction
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.vehicle.states import separate


def _shed(scene: VehicleScene, values: Values) -> None:
    """Reduce the circulation as dynamic_stall does, and add the circulation y of the vortex.

    y' = Delta' - V / (chords c) y, where Delta is the circulation that separation has taken; y is thus Delta less its
    value delayed by ``chords``.
    """
    flow, chord = scene.flow, scene.chords
    before = flow.circulation.copy()
    separate(attached_fraction(scene, values), values["share"], scene.wings.rotation, flow.circulation)
    lost = before - flow.circulation
    vortex = lost - scene.follow(1.0 / (values["chords"][:, None] * chord), lost)
    flow.circulation += values["vortex"][:, None, None] * vortex


EFFECT = effect_of_air(
    name="stall_vortex",
    title="Dynamic stall with a shed vortex",
    size=(
        Parameter("share", "1", 0.0, 1.0, 0.5, "fraction of Kirchhoff's loss of lift that occurs; 1 is the full loss"),
    ),
    shape=(
        Parameter("vortex", "1", 0.0, 1.5, 1.0, "circulation of the vortex when it forms, over what separation takes"),
        Parameter(
            "chords", "1", 0.5, 10.0, 3.0, "distance in which the vortex decays, in chords travelled", scale="log"
        ),
        *SEPARATION,
    ),
    memory="the attached fraction of the chord and the lost circulation at each station of a vehicle's wing",
    law="Delta = share Gamma_alpha (1 - ((1 + X^(1/2)) / 2)^2),     X as in dynamic_stall\n"
    "y' = Delta' - V y / (chords c)\nGamma' = Gamma - Delta + vortex y",
    source="Leishman and Beddoes (1989), Journal of the American Helicopter Society 34, 3: vortex lift is fed by the "
    "lift that separation takes, and decays; Leishman (2006), section 9.5; Goman and Khrabrov (1994): X",
    signature="lift first overshoots at high angles of attack and then breaks down late in each stroke",
    confused_with=("dynamic_stall", "circulation_lag", "wake_capture", "varying_coefficients"),
    vehicle=deferred("circulation", _shed),
)
