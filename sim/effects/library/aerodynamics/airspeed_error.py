"""The stream is faster than it is said to be: a blocked tunnel, or an anemometer that is off."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    scene.wind = scene.wind * (1.0 + values["part"])


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.airspeed *= 1.0 + values["part"]


EFFECT = Effect(
    name="airspeed_error",
    title="Airspeed error, tunnel blockage",
    family="aerodynamics",
    port="air",
    size=(Parameter("part", "1", -0.4, 0.4, 0.05, "part by which the stream at the wing is faster than told"),),
    source="U' = U (1 + part); solid and wake blockage speed a closed tunnel up so (Barlow, Rae and Pope 1999, ch. 10)",
    signature="an error that grows with airspeed and is absent without a stream",
    confused_with=("residual_air", "induced_inflow"),
    wing=_wing,
    vehicle=_vehicle,
)
