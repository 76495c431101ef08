"""The tracker takes two neighbouring markers for each other."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.markers import PLACE, nearest
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    pairs = nearest(sampling.wing, values)[:, :2]
    for beat, (one, other), part in zip(sampling.beat, pairs, values["part"], strict=True):
        was = beat[:, one].copy()
        # Not p + part (q - p): that is not q to the last digit where the part is one.
        beat[:, one] = (1.0 - part) * was + part * beat[:, other]
        beat[:, other] = (1.0 - part) * beat[:, other] + part * was


EFFECT = Effect(
    name="marker_swap",
    title="Markers swapped",
    family="measurement",
    port="observation",
    size=(
        Parameter(
            "part", "1", 0.0, 1.0, 1.0, "part of the frames, spread evenly over the beat, in which they are swapped"
        ),
    ),
    shape=PLACE,
    source="exchange of labels between tracks (identity switch; Bernardin and Stiefelhagen 2008, CLEAR MOT metrics); "
    "in part, the mean over the frames, which least squares sees",
    signature="two neighbours have each other's path: opposite displacements of equal length, alike in every condition",
    confused_with=("marker_slip",),
    observe=_observe,
    observed=("tracks",),
)
