"""Columns that a motion that repeats is fitted with."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Float


def columns(times: Float[Array, " T"], frequency: float, harmonics: int, *, drifts: bool = False) -> Array:
    """Return one, the time if it ``drifts``, cosines and sines of ``harmonics`` of ``frequency`` (Hz), [T, P].

    ``times``: s.
    """
    turn = 2 * np.pi * frequency * times[:, None] * np.arange(1, harmonics + 1)
    drift = [times - times[0]] if drifts else []
    return np.column_stack([np.ones_like(times), *drift, np.cos(turn), np.sin(turn)])
