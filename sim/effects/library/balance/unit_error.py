"""Measurement fault: the forces are in another unit than described."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    sampling.beat = sampling.beat * (1.0 + values["part"])[:, None, None]


EFFECT = fault_of_forces(
    name="unit_error",
    title="Wrong unit of the forces",
    size=(
        Parameter(
            "part",
            "1",
            -0.9999,
            10_000.0,
            101.0,
            "relative error: 101 for gram-force instead of newtons, 999 for millinewtons, -0.78 for pounds",
            positions=(100.97, 999.0, -0.7752),
        ),
    ),
    law="F' = (1 + part) F",
    source="BIPM (2019), The International System of Units, 9th edition: newton, and units outside the SI",
    signature="all forces are larger or smaller by the same large factor in every condition",
    confused_with=("scale_error", "residual_air"),
    observe=_observe,
)
