"""Forces in body axes as lift and drag."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, ArrayLike


def lift_drag(forces: ArrayLike, pitch: float) -> Array:
    """Lift and drag [..., 2] of ``forces`` (x, z) [..., 2] in body axes at body pitch ``pitch`` (rad), level flight.

    L = X sin theta_b - Z cos theta_b, D = -X cos theta_b - Z sin theta_b (Armanini et al. 2016, Eq. 16).
    """
    x, z = np.moveaxis(np.asarray(forces, float), -1, 0)
    sine, cosine = np.sin(pitch), np.cos(pitch)
    return np.stack([x * sine - z * cosine, -x * cosine - z * sine], axis=-1)
