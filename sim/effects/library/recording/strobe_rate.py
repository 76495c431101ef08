"""The ratio of the beat's frequency to the rate of the frames is not what it is taken for."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    times = sampling.times
    # Tracks are placed on the beat by the whole recording: its middle is where their phase is right.
    start = times.mean(axis=1, keepdims=True) if sampling.kind == "tracks" else times[:, :1]
    sampling.times = times + values["part"][:, None] * (times - start)


EFFECT = Effect(
    name="strobe_rate",
    title="Strobe-rate error",
    family="measurement",
    port="observation",
    size=(
        Parameter("part", "1", -2e-3, 2e-3, 1e-4, "part by which the beat is faster, in samples, than it is taken for"),
    ),
    source="aliased time: with a beat of f(1 + e) the phase at t is 2 pi f (1 + e) t, and each frame, from "
    "another beat, adds to the error (van der Grinten, The bird is the word, Appendix A; Bendat and Piersol "
    "2010, Random Data)",
    signature="the phase runs away steadily from the first to the last frame: markers scatter about their path in "
    "proportion to their speed, more the longer the recording",
    confused_with=("clock_offset", "tracker_lag"),
    observe=_observe,
    observed=("tracks", "forces"),
)
