"""All lengths, or all forces, are too large by a constant factor."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    factor = 1.0 + values["part"]
    sampling.beat = sampling.beat * factor.reshape(-1, *(1,) * (sampling.beat.ndim - 1))


EFFECT = Effect(
    name="scale_error",
    title="Scale error",
    family="measurement",
    port="observation",
    size=(Parameter("part", "1", -0.1, 0.1, 0.01, "part by which recorded lengths, or forces, are too large"),),
    source="similarity p' = (1 + s) p: the scale of a reconstruction is that of its reference length (Luhmann et al. "
    "2014, Close-Range Photogrammetry); F' = (1 + s) F: gain of a balance (AIAA R-091A 2020)",
    signature="the whole wing is larger, at rest as in motion, or all forces are; the same part in every condition",
    confused_with=("stroke_amplitude", "camera_shift", "lens_distortion"),
    observe=_observe,
    observed=("tracks", "forces"),
)
