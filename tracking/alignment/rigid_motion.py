"""First look at tracks of unknown identity: their common motion as one rigid body, and the axis it turns about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread

_ROUNDS = 25
_NEED = 3


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Motion of K tracks as one body that is as rigid as possible.

    Attributes:
        shape: [K, 3] positions on the body, m, in the camera axes of no particular instant; NaN where undetermined.
        rotation, shift: [T, 3, 3] and [T, 3], from ``shape`` to the cameras; NaN in frames with too few tracks.
        misfit: [K] root mean square distance from the rigid body of each track, m.
        weight: [K] from 0 (does not move with the body) to 1.
        axis: [3] unit vector that turns least, in the axes of ``shape``.
        pivot: [3] point of ``shape`` that moves least, m.
        angle: [T] turn about the axis, rad, from the mean.
        steadiness: RMS motion of the pivot, m.
    """

    shape: Array
    rotation: Array
    shift: Array
    misfit: Array
    weight: Array
    axis: Array
    pivot: Array
    angle: Array
    steadiness: float


@one_blas_thread
def rigid_motion(tracks: Array) -> RigidMotion:
    """Return the common motion of ``tracks`` [T, K, 3] (m; NaN where not seen). ValueError if too few are seen at once.

    Generalised Procrustes analysis with weights for tracks and samples, so that tracks that do not belong to the wing
    and samples of swapped tracks count little.
    """
    seen: Mask = np.asarray(np.isfinite(tracks).all(axis=-1))
    first = int(np.argmax(seen.sum(axis=1)))
    if seen[first].sum() < 4:
        raise ValueError(f"at most {int(seen[first].sum())} tracks are seen at once; at least 4 are needed")
    P = np.where(seen[..., None], tracks, 0.0)
    shape = np.where(seen[first][:, None], tracks[first], np.nan)
    each = seen.astype(float)
    track_weight = np.ones(tracks.shape[1])
    for _ in range(_ROUNDS):
        known = np.isfinite(shape[:, 0])
        weight = each * track_weight * known
        R, p, fitted = _poses(np.nan_to_num(shape), P, weight)
        back = np.einsum("tji,tkj->tki", R, P - p[:, None])
        use = seen & fitted[:, None]
        w = np.where(use, each, 0.0)[..., None]
        total = w.sum(axis=0)
        shape = np.where(total > 0, (w * np.nan_to_num(back)).sum(axis=0) / np.maximum(total, 1e-12), np.nan)
        away = np.where(use, np.linalg.norm(np.nan_to_num(back - shape), axis=-1), np.nan)
        with np.errstate(invalid="ignore"):
            misfit = np.array([np.sqrt(np.nanmean(one**2)) if np.isfinite(one).any() else np.inf for one in away.T])
            typical = np.array([np.nanmedian(one) if np.isfinite(one).any() else np.inf for one in away.T])
        scale = max(float(np.median(typical[np.isfinite(typical)])), 1e-9)
        own = np.maximum(typical, scale)
        each = np.where(use, 1 / (1 + (np.nan_to_num(away) / (3 * own)) ** 2), 0.0)
        track_weight = 1 / (1 + (typical / (2 * scale)) ** 2)
    R, p = np.where(fitted[:, None, None], R, np.nan), np.where(fitted[:, None], p, np.nan)
    axis, pivot, angle, steadiness = _hinge(R[fitted], p[fitted])
    every = np.full(len(R), np.nan)
    every[fitted] = angle
    return RigidMotion(shape, R, p, misfit, track_weight, axis, pivot, every, steadiness)


def _poses(shape: Array, P: Array, weight: Array) -> tuple[Array, Array, Mask]:
    """Weighted least-squares poses [T, 3, 3], [T, 3] of ``shape`` in ``P``, and the frames [T] that have one."""
    count = np.maximum(weight.sum(axis=1), 1e-12)[:, None]
    b0 = np.einsum("tk,ki->ti", weight, shape) / count
    p0 = np.einsum("tk,tki->ti", weight, P) / count
    b = shape[None] - b0[:, None]
    U, s, Vt = np.linalg.svd(np.einsum("tk,tki,tkj->tij", weight, b, P - p0[:, None]))
    U[:, :, 2] *= (np.linalg.det(U) * np.linalg.det(Vt))[:, None]
    R = np.swapaxes(U @ Vt, 1, 2)
    fitted = ((weight > 0).sum(axis=1) >= _NEED) & (s[:, 1] > 1e-6 * np.maximum(s[:, 0], 1e-30))
    return R, p0 - np.einsum("tij,tj->ti", R, b0), fitted


def _hinge(R: Array, p: Array) -> tuple[Array, Array, Array, float]:
    """Axis [3] and point [3] of the body that move least in poses ``R`` [T, 3, 3], ``p`` [T, 3]; turn [T]; motion."""
    dR, dp = R - R.mean(axis=0), p - p.mean(axis=0)
    values, vectors = np.linalg.eigh(np.einsum("tij,tik->jk", dR, dR))
    axis = vectors[:, 0]
    right = -np.einsum("tij,ti->j", dR, dp)
    pivot = sum((v @ right) / max(float(e), 1e-12) * v for e, v in zip(values[1:], vectors.T[1:], strict=True))
    a = vectors[:, 1]
    b = np.cross(axis, a)
    mean = R.mean(axis=0)
    turned = np.einsum("tij,j->ti", R, a)
    along, across = turned @ (mean @ a), turned @ (mean @ b)
    angle = np.arctan2(across, along)
    moved = np.einsum("tij,j->ti", dR, pivot) + dp
    return axis, np.asarray(pivot), angle - angle.mean(), float(np.sqrt((moved**2).sum(axis=1).mean()))
