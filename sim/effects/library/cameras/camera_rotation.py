"""Measurement fault: the cameras' frame is rotated relative to the frame of the wing."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, fault_of_tracks
from wingfit.sim.effects.ports.observation import Sampling

_TINY = 1e-8  # rad: below, (1 - cos a) / a^2 is 1/2 to the last digit, and would be 0 / 0


def rotation(turn: Array) -> Array:
    """Return the rotation matrices [B, 3, 3] of the rotation vectors ``turn`` [B, 3] in rad (Rodrigues 1840)."""
    angle = np.sqrt((turn * turn).sum(axis=1))
    safe = np.maximum(angle, _TINY)
    first = np.sin(safe) / safe
    second = 2.0 * (np.sin(0.5 * safe) / safe) ** 2
    x, y, z = turn.T
    zero = np.zeros(len(turn))
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    outer = turn[:, :, None] * turn[:, None, :] - (angle * angle)[:, None, None] * np.eye(3)
    return np.asarray(np.eye(3) + first[:, None, None] * cross + second[:, None, None] * outer)


def _observe(sampling: Sampling, values: Values) -> None:
    R = rotation(np.stack([values[axis] for axis in "xyz"], axis=1))[:, None, None]
    p = sampling.beat
    # Written out: a matrix product may round differently in a batch of another size.
    sampling.beat = R[..., 0] * p[..., 0:1] + R[..., 1] * p[..., 1:2] + R[..., 2] * p[..., 2:3]


EFFECT = fault_of_tracks(
    name="camera_rotation",
    title="Camera frame rotated",
    size=tuple(
        Parameter(axis, "rad", -0.2, 0.2, 0.01, f"{axis} of the rotation vector from the true to the recorded frame")
        for axis in "xyz"
    ),
    law="p' = R p,     R = exp((x, y, z)~)",
    source="Rodrigues (1840): rotation about the origin by a rotation vector",
    signature="the errors grow with the distance from the hinge, as if a rigid wing were rotated, and are alike in "
    "every condition",
    confused_with=("camera_shift", "hinge_tilt", "stroke_bias"),
    observe=_observe,
)
