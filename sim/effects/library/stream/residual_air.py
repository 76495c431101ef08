"""Effect: the air is denser than its described pressure and temperature imply, as if a vacuum gauge reads too low."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene


def _change(scene: WingScene | VehicleScene, values: Values) -> None:
    scene.density = np.maximum(scene.density + values["density"], 0.0)


_OF_VEHICLES = (-0.7, 1.4)
_TEXT = (
    "air density beyond that at the described pressure and temperature "
    f"(of a vehicle between {_OF_VEHICLES[0]:g} and {_OF_VEHICLES[1]:g})"
)

EFFECT = effect_of_air(
    name="residual_air",
    title="Residual air, density error",
    # Near sea level, the bounds of a vehicle are those of a factor of its forces (scale_error).
    size=(Parameter("density", "kg/m^3", -0.01, 0.1, 0.02, _TEXT, vehicle_bounds=_OF_VEHICLES),),
    law="rho = max(p / (R T) + density, 0)",
    source="Clapeyron (1834): ideal gas law, here with an error of the density and a lower limit of zero",
    signature="aerodynamic forces act in what is described as a vacuum, and in open air all of them change by the same "
    "factor",
    confused_with=("airspeed_error", "scale_error", "stroke_amplitude", "added_mass_error"),
    wing=_change,
    vehicle=_change,
)
