"""The amplifier of the balance is a causal low-pass filter, which delays."""

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
    size=(Parameter("delay", "s", 0.0, 0.02, 0.001, "delay of a slow signal"),),
    shape=(
        Parameter("second", "1", 0.0, 1.0, 0.5, "0 for a filter of first order, 1/3 for Bessel, 1/2 for Butterworth"),
    ),
    memory="the filter's output and its rate",
    law="F_k' = F_k / (1 + s + second s^2),     s = 2 pi i k f delay",
    source="low-pass filters of first and second order (Tietze, Schenk and Gamm 2008, Electronic Circuits)",
    signature="forces lag and higher harmonics are smaller; both grow with the flap frequency",
    confused_with=("clock_offset", "circulation_lag", "balance_resonance"),
    observe=_observe,
)
