"""Measurement fault: the forces along x and z are recorded in each other's place."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    beat = sampling.beat
    sampling.beat = beat + values["part"][:, None, None] * (beat[..., ::-1] - beat)


EFFECT = fault_of_forces(
    name="axis_swap",
    title="Axes of the forces swapped",
    size=(Parameter("part", "1", 0.0, 1.0, 1.0, "1: both forces are in each other's place", positions=(1.0,)),),
    law="X' = X + part (Z - X)\nZ' = Z + part (X - Z)",
    source="AIAA R-091A (2020), Calibration and Use of Internal Strain-Gage Balances: order of the components",
    signature="the force along x has the shape that is expected of that along z, and the reverse",
    confused_with=("axis_sign", "balance_tilt"),
    observe=_observe,
)
