"""The amplifier of the balance low-passes one way, and so delays."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    s = 2j * np.pi * sampling.harmonics * values["delay"][:, None]
    sampling.filtered(1.0 / (1.0 + s + values["second"][:, None] * s * s))


EFFECT = Effect(
    name="filter_delay",
    title="Filter delay",
    family="measurement",
    port="observation",
    size=(Parameter("delay", "s", 0.0, 0.02, 0.001, "tau: delay of a slow signal"),),
    shape=(
        Parameter(
            "second", "1", 0.0, 1.0, 0.5, "b: 0 for a filter of first order, 1/3 for Bessel, 1/2 for Butterworth"
        ),
    ),
    memory="the filter's output and its rate",
    source="1 / (1 + tau s + b (tau s)^2) (Tietze, Schenk and Gamm 2008, Electronic Circuits: low-pass "
    "filters of first and second order)",
    signature="forces lag, and higher harmonics are smaller as well; the more, the faster the wing flaps",
    confused_with=("clock_offset", "circulation_lag", "balance_resonance"),
    observe=_observe,
    observed=("forces",),
)
