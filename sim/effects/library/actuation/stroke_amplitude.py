"""The wings flap further than they are said to."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.flap[:, 1:] *= (1.0 + values["part"])[:, None]


def _wing(scene: WingScene, values: Values) -> None:
    scene.rods.series[1:] *= 1.0 + values["part"]


EFFECT = Effect(
    name="stroke_amplitude",
    title="Stroke amplitude error",
    family="actuation",
    port="drive",
    size=(Parameter("part", "1", -0.4, 0.4, 0.05, "part by which all harmonics of the stroke are larger than told"),),
    source=(
        "every harmonic k > 0 of the flap angle is multiplied by 1 + part, rates and accelerations with it; "
        "wing pitch that follows the stroke does so (Armanini et al. 2016, Eqs. 17, 20-21)"
    ),
    signature="forces grow with the square, displacements in proportion, with hardly a change of shape over the beat",
    confused_with=("scale_error", "residual_air"),
    wing=_wing,
    vehicle=_vehicle,
)
