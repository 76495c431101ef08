"""A mass that nobody weighed: a drop of glue, a marker."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values
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
    size=(Parameter("mass", "kg", 0.0, 0.5, 0.05, "mass of the point", of="mass"),),
    shape=(
        Parameter("station", "1", 0.0, 1.0, 0.8, "where it is, part of the span from root to tip", place=True),
        Parameter("chord", "1", 0.0, 1.0, 0.8, "where it is, part of the chord from the leading edge", place=True),
    ),
    power="conservative",
    source="Newton's second law for a point fixed to a body; Rayleigh, The Theory of Sound (1877), ch. VIII: a load on "
    "a bar",
    signature="all that lies near one place lags where the stroke turns round, in vacuum as in air, and sags at rest",
    confused_with=("added_mass", "mass_offset", "damage"),
    wing=_wing,
)
