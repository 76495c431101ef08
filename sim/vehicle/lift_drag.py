"""Conversion of forces in body axes to lift and drag."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, ArrayLike


def lift_drag(forces: ArrayLike, pitch: float) -> Array:
    """Lift and drag [..., 2] in level flight of ``forces`` (X, Z) [..., 2] in body axes, in the unit of ``forces``.

    L = X sin theta_b - Z cos theta_b, D = -X cos theta_b - Z sin theta_b (Armanini et al. 2016, Eq. 16), ``pitch``
    (rad) being the body pitch theta_b.
    """
    x, z = np.moveaxis(np.asarray(forces, float), -1, 0)
    sine, cosine = np.sin(pitch), np.cos(pitch)
    return np.stack([x * sine - z * cosine, -x * cosine - z * sine], axis=-1)
