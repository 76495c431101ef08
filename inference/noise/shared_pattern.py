"""How much of what differs between beats is a motion that the markers of a wing share.

The noise of single markers is as large in patterns that are smooth over the wing as in all others, whatever its
colour. A stiffness that drifts, or a motor that is not steady, changes the motion of the whole wing smoothly. Where two
apparent beats are too few to show a slow change, this still shows in the power of the smooth patterns: polynomials of
the second degree in the markers' mean positions. A camera that shakes moves all markers alike, which is not counted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from wingfit.records.array_types import Array, Bool, Float, Mask

SMOOTH = 6  # polynomials up to the second degree, of which the first is the same for all markers
LEAST_MARKERS = 2 * SMOOTH  # in a frame
LEAST_FRAMES = 30
MOST_FRAMES = 500  # that are used
CHANCE = 1e-4  # probability with which noise of single markers appears as a shared motion in a recording


class _Powers(NamedTuple):
    """Sums of squares in smooth patterns and in others, the numbers of these patterns, and the independent frames."""

    smooth: float
    other: float
    smooth_patterns: int
    other_patterns: int
    frames: float


def shared_part(scatter: Float[Array, "T C"], valid: Bool[Mask, "T C"], positions: Float[Array, "T C"]) -> float:
    """Return the part of the power of ``scatter`` [T, C] (recorded minus mean beat, m) that is a shared motion.

    C: x, y, z of each marker in turn; T frames; ``positions`` [T, C]: as recorded, m. What all markers share in a frame
    is subtracted first. The power of noise of single markers in smooth patterns, known from the other patterns, is not
    counted. 0 for too few markers or frames, and where noise of single markers explains the power.
    """
    frames, channels = scatter.shape
    if channels % 3 or channels < 3 * LEAST_MARKERS or frames < LEAST_FRAMES:
        return 0.0
    every = -(-frames // MOST_FRAMES)
    shape = -1, channels // 3, 3
    known = np.all(valid[::every].reshape(shape), axis=2)
    places = np.where(known[:, :, None], positions[::every].reshape(shape), 0.0).sum(axis=0)
    places /= np.maximum(known.sum(axis=0), 1)[:, None]
    enough = known.sum(axis=1) >= LEAST_MARKERS
    if enough.sum() < LEAST_FRAMES:
        return 0.0
    found = _powers(scatter[::every].reshape(shape)[enough], known[enough], _polynomials(places))
    if found.other <= 0.0:
        return 0.0
    noise = found.other / found.other_patterns
    ratio = found.smooth / found.smooth_patterns / noise
    freedom = [2.0 * found.frames * n / enough.sum() for n in (found.smooth_patterns, found.other_patterns)]
    if scipy.stats.f.sf(ratio, *freedom) > CHANCE:
        return 0.0
    return (found.smooth - noise * found.smooth_patterns) / (found.smooth + found.other)


def _polynomials(places: Array) -> Array:
    """Polynomials [M, SMOOTH] of up to the second degree in the ``places`` [M, 3] along their two main directions."""
    axes, sizes, _ = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)
    x, y = (axes[:, :2] * (sizes[:2] > 0.0)).T * np.sqrt(len(places))
    return np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y], axis=1)


def _powers(values: Array, known: Array, smooth: Array) -> _Powers:
    """Split the power of ``values`` [T, M, 3], without what all markers share, into smooth and other patterns.

    ``known`` [T, M]: markers with a value; ``smooth`` [M, SMOOTH]: polynomials. Frames whose noise is correlated count
    as fewer independent ones (Bretherton et al. 1999, Journal of Climate 12, 1990: eigenvalues of the covariance).
    """
    values = np.where(known[:, :, None], values, 0.0)
    basis = np.linalg.qr(smooth * known[:, :, None])[0]  # the first column is the same for all known markers
    parts = np.einsum("tmq,tmi->tqi", basis, values)
    rest = values - np.einsum("tmq,tqi->tmi", basis, parts)
    rows = rest.reshape(len(rest), -1)
    square = rows @ rows.T
    other, spread = float(np.trace(square)), float((square**2).sum())
    patterns = int((known.sum(axis=1) - SMOOTH).sum())
    independent = other**2 / spread if spread > 0.0 else 0.0
    return _Powers(float((parts[:, 1:] ** 2).sum()), other, (SMOOTH - 1) * len(values), patterns, independent)
