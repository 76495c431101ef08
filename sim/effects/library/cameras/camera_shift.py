"""Measurement fault: the origin of the cameras' frame is not where the dataset describes it."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_tracks
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    shift = np.stack([values["x"], values["y"], values["z"]], axis=1)
    sampling.beat = sampling.beat + shift[:, None, None, :]


EFFECT = fault_of_tracks(
    name="camera_shift",
    title="Camera frame shifted",
    size=tuple(
        Parameter(axis, "m", -0.2, 0.2, 0.02, f"shift of all recorded positions along {axis}", of="chord")
        for axis in "xyz"
    ),
    law="p' = p + (x, y, z)",
    source="Luhmann et al. (2014), Close-Range Photogrammetry: rigid motion of the measured frame",
    signature="every marker is off by the same vector at every phase, in every condition",
    confused_with=("hinge_offset", "camera_rotation"),
    observe=_observe,
)
