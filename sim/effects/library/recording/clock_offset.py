"""The recording's clock starts at another instant than it is said to."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    sampling.times = sampling.times + values["delay"][:, None]


EFFECT = Effect(
    name="clock_offset",
    title="Clock offset",
    family="measurement",
    port="observation",
    size=(Parameter("delay", "s", -0.01, 0.01, 0.001, "by which each sample was taken later than its time says"),),
    source="t' = t + d: latency of a trigger (Bendat and Piersol 2010, Random Data: a time delay as a phase "
    "that grows in proportion to frequency)",
    signature="forces lead by the same time at every harmonic; in tracks nothing, as their beat is placed by what they "
    "show themselves",
    confused_with=("filter_delay", "strobe_rate", "circulation_lag"),
    observe=_observe,
    observed=("tracks", "forces"),
)
