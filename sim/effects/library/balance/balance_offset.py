"""Measurement fault: the balance indicates a force where there is none."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    sampling.added += sampling.along_axes(values["x"], values["z"])[:, None]


EFFECT = fault_of_forces(
    name="balance_offset",
    title="Balance zero offset",
    size=tuple(
        Parameter(axis, "1", -0.3, 0.3, 0.02, f"indicated force along {axis} without load, in weights") for axis in "xz"
    ),
    law="F' = F + m g (x, z)",
    source="AIAA R-091A (2020), Calibration and Use of Internal Strain-Gage Balances: zero shift of a balance",
    signature="a constant force is added, alike at every phase and in every condition",
    confused_with=("balance_drift", "balance_tilt"),
    observe=_observe,
)
