"""Effect: the stream is faster than described in the dataset, by tunnel blockage or a wrong anemometer."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    scene.wind = scene.wind * (1.0 + values["part"])


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.airspeed *= 1.0 + values["part"]


EFFECT = effect_of_air(
    name="airspeed_error",
    title="Airspeed error, tunnel blockage",
    size=(
        Parameter(
            "part", "1", -0.4, 0.4, 0.05, "relative error of airspeed; positive if the air is faster than described"
        ),
    ),
    law="U' = U (1 + part)",
    source="Barlow, Rae and Pope (1999), Low-Speed Wind Tunnel Testing, ch. 10: solid and wake blockage raise the "
    "airspeed in a closed tunnel",
    signature="the error grows with the airspeed and is absent without a stream",
    confused_with=("residual_air", "induced_inflow"),
    wing=_wing,
    vehicle=_vehicle,
)
