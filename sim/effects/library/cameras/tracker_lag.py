"""Measurement fault: the tracker, a Kalman filter of constant acceleration, smooths marker positions over frames."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wingfit.sim.effects.contract import Array, Parameter, Values, fault_of_tracks
from wingfit.sim.effects.ports.observation import Sampling

_BISECTIONS = 60


def steady_gains(smoothing: Array) -> tuple[Array, Array, Array]:
    """Return the steady gains alpha, beta, gamma [B] of the tracker's filter.

    They correct position, velocity per frame and acceleration per frame^2 by multiples of the innovation (measured
    minus predicted position). ``smoothing`` [B] = sigma_w / (sigma_v T^2) > 0: position noise sigma_w over acceleration
    noise sigma_v times the frame time T squared. With s^2 = 1 - alpha: beta = 2 (1 - s)^2, gamma = beta^2 / (2 alpha),
    and 1 / smoothing = gamma / s (Kalata 1984; Bar-Shalom, Li and Kirubarajan 2001, section 6.5).
    """
    low, high = np.zeros(len(smoothing)), np.ones(len(smoothing))
    for _ in range(_BISECTIONS):  # of 2 (1 - s)^3 x smoothing = s (1 + s), whose one root lies in (0, 1)
        s = 0.5 * (low + high)
        above = s * (1.0 + s) > 2.0 * (1.0 - s) ** 3 * smoothing
        low, high = np.where(above, low, s), np.where(above, s, high)
    s = 0.5 * (low + high)
    return 1.0 - s * s, 2.0 * (1.0 - s) ** 2, 2.0 * (1.0 - s) ** 3 / (1.0 + s)


def response(smoothing: Array, angle: Array) -> npt.NDArray[np.complex128]:
    """Return the complex gain [B, K] of the filtered position for a sine that turns by ``angle`` [K] rad per frame.

    It is N / (N + (1 - alpha) d^3) with d = 1 - q, q = exp(-i angle), N = alpha d^2 + beta q d + gamma q (q + d / 2)
    and the gains of :func:`steady_gains` for ``smoothing`` [B].
    """
    alpha, beta, gamma = (gain[:, None] for gain in steady_gains(smoothing))
    q = np.exp(-1j * angle)
    d = 1.0 - q
    passed = alpha * d * d + beta * q * d + gamma * q * (q + 0.5 * d)
    return np.asarray(passed / (passed + (1.0 - alpha) * d * d * d))


def apparent_step(times: Array, frequency: float) -> float:
    """Return the angle (rad) by which a beat of ``frequency`` (Hz) seems to advance per frame, in [-pi, pi].

    ``times`` [T]: instants of the frames, s. Each strobed frame is from another beat; if the strobe is slightly faster
    than the wing, the beat seems to run backwards.
    """
    beats = float(np.median(np.diff(times))) * frequency
    return 2.0 * np.pi * (beats - round(beats))


def _observe(sampling: Sampling, values: Values) -> None:
    recording = sampling.recording
    step = apparent_step(recording.times, recording.condition.flap_frequency)
    order = np.arange(sampling.beat.shape[1] // 2 + 1)
    sampling.filtered(response(values["smoothing"], order * step))


_TEXT = "position noise divided by (acceleration noise times frame time squared), as the filter assumes them"

EFFECT = fault_of_tracks(
    name="tracker_lag",
    title="Tracker lag and smoothing",
    size=(Parameter("smoothing", "1", 0.0, 100.0, 2.0, _TEXT),),
    memory="position, velocity and acceleration of each marker, carried from frame to frame",
    law="H = N / (N + (1 - alpha) d^3),     N = alpha d^2 + beta q d + gamma q (q + d / 2)\n"
    "2 (1 - s)^3 smoothing = s (1 + s),   alpha = 1 - s^2,   beta = 2 (1 - s)^2,   gamma = beta^2 / (2 alpha)",
    source="Kalata (1984), The tracking index, and Bar-Shalom, Li and Kirubarajan (2001), Estimation with Applications "
    "to Tracking and Navigation, sections 6.3.3 and 6.5: Kalman filter of constant acceleration in steady state",
    signature="higher harmonics are too small and lag in the order of the frames (in the beat they lead, if the strobe "
    "is faster than the wing), by amounts that depend only on the number of frames per apparent beat",
    confused_with=("camera_desync", "rolling_shutter"),
    observe=_observe,
)
