"""Measurement fault: marker positions are smoothed over frames, each being mixed with the smoothed one before."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wingfit.sim.effects.contract import Array, Parameter, Values, fault_of_tracks
from wingfit.sim.effects.library.cameras.tracker_lag import apparent_step
from wingfit.sim.effects.ports.observation import Sampling


def response(weight: Array, angle: Array) -> npt.NDArray[np.complex128]:
    """Return the complex gain [B, K] for a sine that turns by ``angle`` [K] rad per frame; ``weight`` [B]."""
    return np.asarray((1.0 - weight[:, None]) / (1.0 - weight[:, None] * np.exp(-1j * angle)))


def _observe(sampling: Sampling, values: Values) -> None:
    recording = sampling.recording
    step = apparent_step(recording.times, recording.condition.flap_frequency)
    order = np.arange(sampling.beat.shape[1] // 2 + 1)
    sampling.filtered(response(values["weight"], order * step))


EFFECT = fault_of_tracks(
    name="exponential_smoothing",
    title="Exponential smoothing of tracks",
    size=(Parameter("weight", "1", 0.0, 0.8, 0.3, "weight of the smoothed position of the frame before"),),
    memory="the smoothed position of each marker",
    law="y_n = weight y_(n-1) + (1 - weight) p_n",
    source="Brown (1963), Smoothing, Forecasting and Prediction of Discrete Time Series, ch. 7: simple exponential "
    "smoothing, which motion capture software offers",
    signature="all harmonics are too small and late in the order of the frames, the higher the more",
    confused_with=("tracker_lag", "camera_desync", "rolling_shutter"),
    observe=_observe,
)
