"""Measurement fault: all recorded lengths, or all forces, are too large by a constant factor."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, fault_of_recordings
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    factor = 1.0 + values["part"]
    sampling.beat = sampling.beat * factor.reshape(-1, *(1,) * (sampling.beat.ndim - 1))


_OF_FORCES = (-0.6, 1.2)
_TEXT = (
    f"relative error of recorded lengths or forces (of forces between {_OF_FORCES[0]:g} and {_OF_FORCES[1]:g}); "
    "positive if they are too large"
)

EFFECT = fault_of_recordings(
    name="scale_error",
    title="Scale error",
    size=(
        # Free coefficients absorb most of a factor of forces, as they do of the air's density and of added mass: these
        # three have the same bounds, so that none stands in for another that has ended at its bound.
        Parameter("part", "1", -0.3, 0.3, 0.01, _TEXT, vehicle_bounds=_OF_FORCES),
    ),
    law="p' = (1 + part) p          tracks\nF' = (1 + part) F          forces",
    source="Luhmann et al. (2014), Close-Range Photogrammetry: a reconstruction takes its scale from a reference "
    "length; AIAA R-091A (2020): gain of a balance",
    signature="the whole wing is larger, at rest as in motion, or all forces are larger, by the same factor in every "
    "condition",
    confused_with=(
        "stroke_amplitude",
        "camera_shift",
        "lens_distortion",
        "added_mass_error",
        "residual_air",
        "axis_scale",
    ),
    observe=_observe,
)
