"""Measurement fault: a force is recorded with the wrong sign."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    sampling.beat = sampling.beat * (1.0 - 2.0 * np.stack([values["x"], values["z"]], axis=1))[:, None]


EFFECT = fault_of_forces(
    name="axis_sign",
    title="Wrong sign of a force",
    size=tuple(
        Parameter(axis, "1", 0.0, 1.0, 1.0, f"1: the force along {axis} has the wrong sign", positions=(1.0,))
        for axis in "xz"
    ),
    law="X' = (1 - 2 x) X\nZ' = (1 - 2 z) Z",
    source="AIAA R-091A (2020), Calibration and Use of Internal Strain-Gage Balances: sign conventions of body axes",
    signature="the force along an axis is mirrored, its mean included, in every condition",
    confused_with=("axis_swap", "body_pitch_convention"),
    observe=_observe,
)
