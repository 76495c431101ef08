"""Forces in weights of a vehicle, along the axes of a recording."""

from __future__ import annotations

import numpy as np

from wingfit.records.dataset import STANDARD_GRAVITY
from wingfit.sim.effects.contract import Array
from wingfit.sim.effects.ports.observation import Sampling


def along_axes(sampling: Sampling, x: Array, z: Array) -> Array:
    """Forces [B, C] in N along the axes of the recording, from ``x`` and ``z`` [B] in weights of the vehicle."""
    weight = sampling.vehicle.mass * STANDARD_GRAVITY
    return weight * np.stack([x if axis == "x" else z for axis in sampling.recording.forces], axis=1)
