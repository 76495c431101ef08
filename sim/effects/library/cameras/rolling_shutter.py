"""Measurement fault: cameras read the rows of an image one after the other while the wing moves."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_tracks, measure
from wingfit.sim.effects.ports.observation import Sampling, between
from wingfit.sim.effects.ports.stereo import PLACES, Stereo

_ROUNDS = 2  # in each an error falls by the marker's speed over that of the read-out, a few hundredths


def _observe(sampling: Sampling, values: Values) -> None:
    wing, frequency = sampling.wing, sampling.recording.condition.flap_frequency
    span, chord = measure(wing, "span"), measure(wing, "chord")
    aft, out = (frequency * values[name][:, None, None] for name in ("along_chord", "along_span"))
    cameras, images = _cameras(sampling, span), []
    for side in (-1.0, 1.0):
        points = sampling.beat
        for _ in range(_ROUNDS + 1):  # a marker is seen when the row is read in which it then is
            rows = cameras.image(points, side)[1] * cameras.distance
            later = aft * points[..., 0] / chord + out * rows / span  # beats after the middle row
            points = np.stack([between(one)(beats) for one, beats in zip(sampling.beat, later, strict=True)])
        images.append(cameras.image(points, side))
    sampling.beat = cameras.points(images[0], images[1])


def _cameras(sampling: Sampling, span: float) -> Stereo:
    """Return a pair of cameras at their typical position, aimed at the middle of the span.

    The position hardly matters: if reading an image takes T along the span, a marker's height is wrong by T z v / b for
    any distance b between the cameras, v being the marker's speed along the span.
    """
    typical = {place.name: place.typical for place in PLACES}
    wing, distance = sampling.wing, typical["distance"] * span
    middle = 0.5 * (wing.stations[0].y + wing.stations[-1].y)
    places = (0.0, middle, distance, typical["base"] * distance)
    return Stereo(*(np.full((len(sampling.beat), 1, 1), place) for place in places))


EFFECT = fault_of_tracks(
    name="rolling_shutter",
    title="Rolling shutter",
    size=(
        Parameter("along_span", "s", -0.02, 0.02, 0.004, "time in which the camera reads the rows from root to tip"),
        Parameter(
            "along_chord",
            "s",
            -0.01,
            0.01,
            0.0005,
            "time in which the camera reads the rows along the mean chord, from front to back",
        ),
    ),
    law="p_k(t) = p(t + d_k),     d_k = along_chord x / c + along_span h v_k / b",
    source="Meingast, Geyer and Sastry (2005), Geometric models of rolling-shutter cameras; Liang, Chang and Chen "
    "(2008). An action camera reads an image in 10 to 20 ms",
    signature="a lag grows steadily along the span (or the chord), in proportion to the flap frequency, and a read-out "
    "along the span also makes heights wrong, because the two cameras read a marker in different rows",
    confused_with=("camera_desync", "phase_lag_error", "tracker_lag"),
    observe=_observe,
)
