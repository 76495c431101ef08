"""Measurement fault: the force along one axis is recorded too large, by a constant factor."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    sampling.beat = sampling.beat * (1.0 + np.stack([values["x"], values["z"]], axis=1))[:, None]


EFFECT = fault_of_forces(
    name="axis_scale",
    title="Scale error of one axis",
    size=tuple(
        Parameter(axis, "1", -0.6, 1.2, 0.05, f"relative error of the force along {axis}; positive if it is too large")
        for axis in "xz"
    ),
    law="X' = (1 + x) X\nZ' = (1 + z) Z",
    source="AIAA R-091A (2020), Calibration and Use of Internal Strain-Gage Balances: a gain for each component",
    signature="the force along one axis is larger by the same factor at every phase and in every condition, and that "
    "along the other is not",
    confused_with=("scale_error", "balance_tilt", "wing_pitch_amplitude", "wing_acceleration"),
    observe=_observe,
)
