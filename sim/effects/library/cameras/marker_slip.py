"""A marker does not sit where it is said to."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.markers import PLACE, nearest, tangents
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    wing = sampling.wing
    slipped = nearest(wing, values)[:, 0]
    for beat, marker, x, y in zip(sampling.beat, slipped, values["x"], values["y"], strict=True):
        along, across = tangents(wing, int(marker))
        # Along the wing as it is bent at that instant, which the markers around it show.
        beat[:, marker] += np.einsum("m,nmi->ni", x * along + y * across, beat)


EFFECT = Effect(
    name="marker_slip",
    title="Marker slipped",
    family="measurement",
    port="observation",
    size=tuple(
        Parameter(axis, "m", -0.3, 0.3, 0.03, f"by which the marker sits {where} of where it is said to", of="chord")
        for axis, where in (("x", "aft"), ("y", "outboard"))
    ),
    shape=PLACE,
    source="material point moved on the surface, p' = p + dp/dX s, with the tangents of a moving least-squares plane "
    "(Lancaster and Salkauskas 1981)",
    signature="one marker is off by a vector that turns with the wing, in every condition; its neighbours are not",
    confused_with=("marker_swap",),
    observe=_observe,
    observed=("tracks",),
)
