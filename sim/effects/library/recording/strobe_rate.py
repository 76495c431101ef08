"""Measurement fault: the ratio of flap frequency to frame rate differs from the recorded one."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, fault_of_recordings
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    times = sampling.times
    # Tracks are placed on the beat by the whole recording: its middle is where their phase is right.
    start = times.mean(axis=1, keepdims=True) if sampling.kind == "tracks" else times[:, :1]
    sampling.times = times + values["part"][:, None] * (times - start)


_TEXT = "relative error of flap frequency over frame rate; positive if the true ratio is larger"

EFFECT = fault_of_recordings(
    name="strobe_rate",
    title="Strobe-rate error",
    size=(Parameter("part", "1", -2e-3, 2e-3, 1e-4, _TEXT),),
    law="t' = t + part (t - t_0)",
    source="van der Grinten, The bird is the word, Appendix A: each frame is from another beat, and the error "
    "accumulates; Bendat and Piersol (2010), Random Data: aliasing",
    signature="the phase drifts steadily from the first frame to the last, so that markers scatter about their path in "
    "proportion to their speed, more in longer recordings",
    confused_with=("clock_offset", "tracker_lag"),
    observe=_observe,
)
