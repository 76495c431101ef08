"""Measurement fault: the clock of the recording is offset by a constant time."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, fault_of_recordings
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    sampling.times = sampling.times + values["delay"][:, None]


EFFECT = fault_of_recordings(
    name="clock_offset",
    title="Clock offset",
    size=(Parameter("delay", "s", -0.01, 0.01, 0.001, "time by which samples are later than their time stamps"),),
    law="F'(t) = F(t + delay)",
    source="Bendat and Piersol (2010), Random Data: a time delay is a phase that grows in proportion to frequency",
    signature="forces lead by the same time at every harmonic, and tracks show nothing, because they are aligned with "
    "the beat by their own motion",
    confused_with=("filter_delay", "strobe_rate", "circulation_lag"),
    observe=_observe,
)
