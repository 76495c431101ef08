"""Effect: the air twists a wing that yields, more where its load is larger."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.vehicle.flow import Flow, StationedWings

PRESSURE = 10.0  # Pa, of which the compliance is the twist
HARMONICS = 6  # of the twist; higher ones are above the resonance of a wing
LARGEST = 1.0  # rad


def _vehicle(scene: VehicleScene, values: Values) -> None:
    def law(wings: StationedWings, flow: Flow) -> Array:
        chord, weight = wings.chord, wings.places.weight
        moment = -np.sum(wings.normal_force(flow).mean(axis=0) * (chord * weight)[:, None], axis=2)
        unit = PRESSURE * np.sum(chord**2 * weight, axis=1)[:, None]
        return np.asarray(np.clip(values["compliance"][:, None] * moment / unit, -LARGEST, LARGEST))

    scene.twist(law, HARMONICS)


EFFECT = effect_of_drive(
    name="elastic_twist",
    title="Elastic twist by the air load",
    size=(
        Parameter(
            "compliance", "rad", -0.1, 1.0, 0.15,
            "twist at the pitch station by a pressure of 10 Pa on the wing",
        ),
    ),
    law="theta_w'(t) = theta_w(t) - compliance int N c dr / (10 Pa int c^2 dr)\n"
    "N = force per length by circulation and drag, along the wing's normal",
    source="Whitney and Wood (2010), J. Fluid Mech. 660, 197: a wing that turns on a spring",
    signature="the wing meets the air at smaller angles while its load is large, the more so the faster it moves",
    confused_with=("wing_pitch_amplitude", "lift_curve", "varying_coefficients"),
    vehicle=deferred("twist", _vehicle),
)  # fmt: skip
