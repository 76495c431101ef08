"""The rows of an image are read one after the other, while the wing moves on."""

from __future__ import annotations

from sim.effects.contract import Effect, Measure, Parameter, Values, measure
from sim.effects.observation import Sampling, between

_ROUNDS = 2  # in each an error falls by the marker's speed over that of the read-out, a few hundredths
_DIRECTIONS: tuple[tuple[str, Measure], ...] = (("along_chord", "chord"), ("along_span", "span"))


def _observe(sampling: Sampling, values: Values) -> None:
    wing, frequency = sampling.wing, sampling.recording.condition.flap_frequency
    middle = 0.5 * (wing.stations[0].y + wing.stations[-1].y)
    aft, out = ((frequency * values[name] / measure(wing, of))[:, None, None] for name, of in _DIRECTIONS)
    row = aft * sampling.beat[..., 0] + out * (sampling.beat[..., 1] - middle)  # beats after the middle one
    for k, rows in enumerate(row):
        row_at, seen = between(rows[..., None]), rows
        for _ in range(_ROUNDS):  # a marker is seen when the row is read in which it then is
            seen = row_at(seen)[..., 0]
        sampling.beat[k] = between(sampling.beat[k])(seen)


EFFECT = Effect(
    name="rolling_shutter",
    title="Rolling shutter",
    family="measurement",
    port="observation",
    size=(
        Parameter(
            "along_span", "s", -0.02, 0.02, 0.004, "time in which the read-out passes the span, from root to tip"
        ),
        Parameter("along_chord", "s", -0.01, 0.01, 0.0005, "time in which it passes the mean chord, aft"),
    ),
    source="Meingast, Geyer and Sastry 2005, Geometric models of rolling-shutter cameras; Liang, Chang and Chen 2008. "
    "An action camera reads an image in 10 to 20 ms; a flash in the dark avoids the fault",
    signature="a lag that grows steadily along the span (or chord), in proportion to the flapping frequency",
    confused_with=("camera_desync", "phase_lag_error", "tracker_lag"),
    observe=_observe,
    observed=("tracks",),
)
