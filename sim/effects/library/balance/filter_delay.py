"""Measurement fault: the amplifier of the balance is a causal low-pass filter, which delays the forces."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    s = 2j * np.pi * sampling.harmonics * values["delay"][:, None]
    sampling.filtered(1.0 / (1.0 + s + values["second"][:, None] * s * s))


EFFECT = fault_of_forces(
    name="filter_delay",
    title="Filter delay",
    size=(Parameter("delay", "s", 0.0, 0.02, 0.001, "delay of a signal that varies slowly"),),
    shape=(
        Parameter(
            "second",
            "1",
            0.0,
            1.0,
            0.5,
            "kind of filter: 0 for first order; for second order 1/3 (Bessel) or 1/2 (Butterworth)",
        ),
    ),
    memory="output of the filter, and the rate of this output",
    law="F_k' = F_k / (1 + s + second s^2),     s = 2 pi i k f delay",
    source="Tietze, Schenk and Gamm (2008), Electronic Circuits: low-pass filters of first and second order",
    signature="forces are late and their higher harmonics too small, and both errors grow with the flap frequency",
    confused_with=("clock_offset", "circulation_lag", "balance_resonance"),
    observe=_observe,
)
