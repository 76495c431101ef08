"""How much of what differs between beats is one pattern that the markers of a wing share.

Noise of single markers has no such pattern, and a camera that shakes moves all markers alike. A stiffness that drifts,
or a motor that is not steady, changes the motion of the whole wing: where two apparent beats are too few to show a slow
change, this pattern still does.
"""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Mask

LEAST_MARKERS, LEAST_FRAMES = 12, 50  # with fewer, noise of single markers shares a pattern by chance
MOST_FRAMES = 500  # that are used


def shared_part(scatter: Float[Array, "T C"], valid: Bool[Mask, "T C"]) -> float:
    """Return the part of the power of ``scatter`` [T, C] (recorded minus mean beat, m) in its strongest pattern.

    C: x, y, z of each marker in turn; T frames. What all markers share in a frame is subtracted first. 0 for too few
    markers or frames. Noise of single markers, however slow, gave at most 0.27 in simulated recordings.
    """
    frames, channels = scatter.shape
    if channels % 3 or channels < 3 * LEAST_MARKERS or frames < LEAST_FRAMES:
        return 0.0
    every = -(-frames // MOST_FRAMES)
    known = valid[::every].reshape(-1, channels // 3, 3)
    apart = np.where(known, scatter[::every].reshape(known.shape), 0.0)
    apart = np.where(
        known, apart - apart.sum(axis=1, keepdims=True) / np.maximum(known.sum(axis=1, keepdims=True), 1), 0.0
    )
    rows = apart.reshape(len(apart), -1)
    power = float(np.sum(rows**2))
    square = rows @ rows.T if len(rows) < channels else rows.T @ rows
    return float(np.linalg.eigvalsh(square)[-1]) / power if power > 0.0 else 0.0
