"""Motion that all tracks share in each frame anew, as of cameras that shake: its size, and its part in a likelihood.

Without it, an error that all M markers of a frame share counts M times. It is a shift of the wing by j in each frame,
normal with the standard deviation ``shake`` of each coordinate. Bending and sweep hide j along x and z; j along y is
seen as the mean over the markers, from which its size is estimated.
"""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Mask

_CUT = 3.0  # standard deviations beyond which a residual counts as that large


def shake_of(residuals: Array, seen: Mask, x: Array, jitter: Array, pose: Array, noise: float, memory: float) -> float:
    """Return the standard deviation of each coordinate of the shake, m; 0 where none is seen.

    Args:
        residuals: [T, M, 3] without the jitter, m; of those in ``seen`` [T, M].
        seen: samples that there are.
        x: [M] of the markers at rest, m.
        jitter: [T, 5] rotation about y and z (rad), shift (m).
        pose: [5, 5] covariance of the part of the jitter that is the body's.
        noise: standard deviation of one coordinate of one sample, m.
        memory: number of consecutive samples that count as one.

    """
    y = np.where(seen, np.clip(np.nan_to_num(residuals[..., 1]), -_CUT * noise, _CUT * noise), 0.0)
    count = np.maximum(seen.sum(axis=1), 1)
    along_y = np.array([0.0, x.mean(), 0.0, 1.0, 0.0])  # of the middle of the markers, by the jitter
    common = y.sum(axis=1) / count + jitter @ along_y
    expected = memory * noise**2 * np.mean(1 / count) + along_y @ pose @ along_y
    return float(np.sqrt(max(float(np.mean(common**2) - expected), 0.0)))


def jitter_precision(pose: Array, shake: float, memory: float) -> Array:
    """Return the inverse covariance [5, 5] of the jitter by that of the body's ``pose`` [5, 5] and ``shake``, m.

    ``memory`` frames of shake count as one.
    """
    return np.asarray(np.linalg.inv(pose + memory * shake**2 * np.diag([0.0, 0.0, 1.0, 1.0, 1.0])))


def body_part(jitter: Array, pose: Array, shake: float, memory: float) -> Array:
    """Return the part of the ``jitter`` [T, 5] that is expected to be the body's; arguments as above."""
    return np.asarray(jitter @ jitter_precision(pose, shake, memory) @ pose)


def jitter_costs(jitter: Array, precision: Array, normal: Array, memory: float) -> Array:
    """Minus twice the log-likelihood [T] of each frame's jitter, integrated over it (Laplace's method).

    Larger jitter explains more, and costs more, also where its size was estimated.

    Args:
        jitter: [T, 5].
        precision: [5, 5] its inverse covariance.
        normal: [T, S + 5, S + 5] inverse covariance of S states and the jitter, given the tracks.
        memory: number of consecutive frames that count as one.

    """
    states = slice(0, normal.shape[1] - len(precision))
    known = np.linalg.slogdet(normal)[1] - np.linalg.slogdet(normal[:, states, states])[1]
    spread = known - np.linalg.slogdet(precision)[1]
    return np.asarray(np.einsum("ta,ab,tb->t", jitter, precision, jitter) + np.maximum(spread, 0.0) / memory)
