"""Effect: a point mass that the dataset does not describe, such as a drop of glue or a marker."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values, place
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    bodies, places = scene.body_at(values["station"], values["chord"])
    for body in np.unique(bodies):
        here = bodies == body
        scene.add_point_mass(int(body), np.where(here, values["mass"], 0.0), places.T)


EFFECT = Effect(
    name="lumped_mass",
    title="Lumped mass",
    family="inertia",
    port="inertia",
    size=(Parameter("mass", "kg", 0.0, 0.5, 0.05, "mass of the added point", of="mass"),),
    shape=place(0.8, 0.8),
    power="conservative",
    law="T = mass |v + omega x a|^2 / 2,     F = mass g",
    source="Newton's second law for a point fixed to a body; Rayleigh (1877), The Theory of Sound, ch. VIII: a load on "
    "a bar",
    signature="the wing near one place lags where the stroke reverses, in vacuum as in air, and sags there at rest",
    confused_with=("added_mass", "mass_offset", "damage"),
    wing=_wing,
)
