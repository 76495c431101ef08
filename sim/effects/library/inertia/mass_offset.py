"""Effect: the mass of the wing lies further aft than described (for a vehicle: behind its pitch axis)."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    """Move the mass of every body aft; its inertia about its own centre stays the same (Steiner's theorem)."""
    aft = np.zeros((3, len(values["distance"])))
    aft[0] = values["distance"]
    across = np.zeros((3, *aft.shape))
    across[1, 1] = across[2, 2] = aft[0] ** 2
    for n, body in enumerate(scene.structure.bodies):
        scene.add_mass(n, np.zeros_like(aft[0]), body.mass * aft, body.mass * across)


def _shift_mass(scene: VehicleScene, values: Values) -> None:
    """Add the forces on the mass of the wings, which the model has on the axis of pitch."""
    mass = scene.stations.mass * scene.setting.vehicle.wing_mass
    moment = mass * (values["distance"] * scene.mass_factor)[:, None, None]
    scene.push_behind(moment, moment)


EFFECT = Effect(
    name="mass_offset",
    title="Centre of mass off its place along the chord",
    family="inertia",
    port="inertia",
    size=(
        Parameter(
            "distance", "m", -0.3, 0.3, 0.05, "distance by which the mass lies aft of its described place", of="chord"
        ),
    ),
    power="conservative",
    law="T = m |v + omega x (distance, 0, 0)|^2 / 2",
    source="Newton's second law for a point fixed to a turning wing; Goldstein (1980), Classical Mechanics, ch. 5: "
    "inertia about a point other than the centre of mass",
    signature="the wing twists, or its force changes, in phase with the accelerations of flap and pitch, in vacuum as "
    "in air",
    confused_with=("lumped_mass", "drive_harmonics", "stroke_bias"),
    wing=_wing,
    vehicle=deferred("mass", _shift_mass),
)
