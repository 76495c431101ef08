"""The air is denser than its pressure and temperature say: a chamber that is not as empty as its gauge reads."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene


def _change(scene: WingScene | VehicleScene, values: Values) -> None:
    scene.density = np.maximum(scene.density + values["density"], 0.0)


EFFECT = Effect(
    name="residual_air",
    title="Residual air, density error",
    family="aerodynamics",
    port="air",
    size=(Parameter("density", "kg/m^3", -0.01, 0.1, 0.02, "density of the air beyond that of the ideal gas told"),),
    source="rho = p / (R T) + density, with the ideal gas law (Clapeyron 1834); never below zero",
    signature="aerodynamic forces in what is called a vacuum; in open air, a change in proportion of all of them",
    confused_with=("airspeed_error", "scale_error", "stroke_amplitude"),
    wing=_change,
    vehicle=_change,
)
