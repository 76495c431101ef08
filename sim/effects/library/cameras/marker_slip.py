"""Measurement fault: a marker is not at its described place on the wing."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_tracks
from wingfit.sim.effects.ports.markers import PLACE, nearest, tangents
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    wing = sampling.wing
    slipped, rest = nearest(wing, values)[:, 0], np.array([m.position[:2] for m in wing.markers])
    for beat, marker, x, y in zip(sampling.beat, slipped, values["x"], values["y"], strict=True):
        along, across = tangents(rest, int(marker), wing.span)
        # Along the wing as it is bent at that instant, which the markers around it show.
        beat[:, marker] += np.einsum("m,nmi->ni", x * along + y * across, beat)


EFFECT = fault_of_tracks(
    name="marker_slip",
    title="Marker slipped",
    size=tuple(
        Parameter(
            axis, "m", -0.3, 0.3, 0.03, f"distance by which the marker lies {where} of its described place", of="chord"
        )
        for axis, where in (("x", "aft"), ("y", "outboard"))
    ),
    shape=PLACE,
    law="p' = p + x dp/dX + y dp/dY",
    source="Lancaster and Salkauskas (1981): a moving least-squares plane, which gives the tangents of the wing at the "
    "marker",
    signature="one marker is off by a vector that turns with the wing, in every condition, and its neighbours are "
    "where they should be",
    confused_with=("marker_swap",),
    observe=_observe,
)
