"""Measurement fault: the tracker exchanges two neighbouring markers."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, fault_of_tracks
from wingfit.sim.effects.ports.markers import PLACE, nearest
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    pairs = nearest(sampling.wing, values)[:, :2]
    for beat, (one, other), part in zip(sampling.beat, pairs, values["part"], strict=True):
        was = beat[:, one].copy()
        # Not p + part (q - p): that is not q to the last digit where the part is one.
        beat[:, one] = (1.0 - part) * was + part * beat[:, other]
        beat[:, other] = (1.0 - part) * beat[:, other] + part * was


EFFECT = fault_of_tracks(
    name="marker_swap",
    title="Markers swapped",
    size=(
        Parameter(
            "part", "1", 0.0, 1.0, 1.0, "fraction of the frames in which the markers are swapped, evenly over the beat"
        ),
    ),
    shape=PLACE,
    law="p_1' = (1 - part) p_1 + part p_2,     p_2' = (1 - part) p_2 + part p_1",
    source="Bernardin and Stiefelhagen (2008), CLEAR MOT metrics: exchange of labels between tracks (identity switch). "
    "In least squares, a swap in a fraction of the frames acts like the mean over the frames",
    signature="two neighbouring markers have each other's path, so that their errors are opposite and of equal length, "
    "alike in every condition",
    confused_with=("marker_slip",),
    observe=_observe,
)
