"""First look at tracks of unknown identity: their common motion as one rigid body, and the axis it turns about."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread

_ROUNDS = 25
_FIRST_ROUNDS = 6
_STARTS = 4  # frames, spread over the recording, from which the alignment begins
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
        pivot: [3] point of ``shape`` that moves least, m; of the line of such points, the one nearest to the tracks.
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
    def angles_of(self, tracks: Array) -> Array:
        """Return the turn [N] (rad) about the axis in frames of ``tracks`` [N, K, 3], m; NaN where too few are seen."""
        seen: Mask = np.asarray(np.isfinite(tracks).all(axis=-1))
        known = np.isfinite(self.shape[:, 0])
        P = np.where(seen[..., None], tracks, 0.0)
        weight: Array = seen.astype(float) * np.where(known, self.weight, 0.0)
        R, _, fitted = _poses(np.nan_to_num(self.shape), P, weight)
        some = self.rotation[np.isfinite(self.angle)]
        found = _turns(R, some.mean(axis=0), self.axis)
        middle = float(np.mean(_turns(some, some.mean(axis=0), self.axis)))
        return np.where(fitted, found - middle, np.nan)


@one_blas_thread
def rigid_motion(tracks: Array) -> RigidMotion:
    """Return the common motion of ``tracks`` [T, K, 3] (m; NaN where not seen). ValueError if too few are seen at once.

    Generalised Procrustes analysis with weights for tracks and samples, so that tracks that do not belong to the wing
    and samples of swapped tracks count little.
    """
    seen: Mask = np.asarray(np.isfinite(tracks).all(axis=-1))
    count = seen.sum(axis=1)
    if count.max(initial=0) < 4:
        raise ValueError(f"at most {int(count.max(initial=0))} tracks are seen at once; at least 4 are needed")
    # Where labels are swapped in the frame that it begins with, it can end in a shape that is not the wing's.
    parts = np.array_split(np.arange(len(tracks)), _STARTS)
    firsts = [int(part[np.argmax(count[part])]) for part in parts if count[part].max(initial=0) >= 4]
    change = distance_changes(tracks)
    typical = np.nanmedian(change, axis=0)
    scale = max(float(np.median(typical[np.isfinite(typical)])), 1e-9)
    track_weight = np.nan_to_num(1 / (1 + (typical / (2 * scale)) ** 2))
    each = np.nan_to_num(1 / (1 + (change / (3 * np.maximum(typical, scale))) ** 2))
    ends = [(_aligned(tracks, seen, first, each, track_weight, _FIRST_ROUNDS)[-1], first) for first in firsts]
    shape, R, p, misfit, track_weight, _ = _aligned(tracks, seen, min(ends)[1], each, track_weight, _ROUNDS)
    fitted = np.isfinite(p[:, 0])
    axis, pivot, angle, steadiness = _hinge(R[fitted], p[fitted])
    every = np.full(len(R), np.nan)
    every[fitted] = angle
    # A point far along the axis would be moved by each error of the axis.
    pivot = pivot + axis * (axis @ (_middle(shape, track_weight) - pivot))
    return RigidMotion(shape, R, p, misfit, track_weight, axis, pivot, every, steadiness)


def _aligned(
    tracks: Array, seen: Mask, first: int, each: Array, track_weight: Array, rounds: int
) -> tuple[Array, Array, Array, Array, Array, float]:
    """Return shape, poses, misfit and weight of :class:`RigidMotion`, and the typical misfit, from a ``first`` frame.

    ``each`` [T, K] and ``track_weight`` [K]: weights of samples and tracks to begin with.
    """
    P = np.where(seen[..., None], tracks, 0.0)
    shape = np.where(seen[first][:, None], tracks[first], np.nan)
    for _ in range(rounds):
        known = np.isfinite(shape[:, 0])
        weight = each * track_weight * known
        R, p, fitted = _poses(np.nan_to_num(shape), P, weight)
        back = np.einsum("tji,tkj->tki", R, P - p[:, None])
        use = seen & fitted[:, None]
        w = np.where(use, each, 0.0)[..., None]
        total = w.sum(axis=0)
        shape = np.where(total > 0, (w * np.nan_to_num(back)).sum(axis=0) / np.maximum(total, 1e-12), np.nan)
        away = np.where(use, np.linalg.norm(np.nan_to_num(back - shape), axis=-1), np.nan)
        misfit, typical = _sizes(away)
        scale = max(float(np.median(typical[np.isfinite(typical)])), 1e-9)
        own = np.maximum(typical, scale)
        each = np.where(use, 1 / (1 + (np.nan_to_num(away) / (3 * own)) ** 2), 0.0)
        track_weight = 1 / (1 + (typical / (2 * scale)) ** 2)
    R, p = np.where(fitted[:, None, None], R, np.nan), np.where(fitted[:, None], p, np.nan)
    return shape, R, p, misfit, track_weight, scale


@one_blas_thread
def distance_changes(tracks: Array) -> Array:
    """Return by how much the distances of each sample of ``tracks`` [T, K, 3] from the others changed, m: [T, K].

    The change is that from the median of the distance over the recording; of the other tracks the median counts. NaN
    where a sample is not seen with another one.
    """
    found = np.full(tracks.shape[:2], np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of slices without a number, whose median is NaN
        for k in range(tracks.shape[1]):
            away = np.linalg.norm(tracks - tracks[:, k, None], axis=-1)
            away[:, k] = np.nan
            found[:, k] = np.nanmedian(np.abs(away - np.nanmedian(away, axis=0)), axis=1)
    return found


def _middle(shape: Array, weight: Array) -> Array:
    """Mean [3] of the known points of ``shape`` [K, 3] (m) with the ``weight`` [K] of tracks."""
    known = np.isfinite(shape[:, 0])
    return np.asarray(weight[known] @ shape[known] / max(float(weight[known].sum()), 1e-12))


def _sizes(away: Array) -> tuple[Array, Array]:
    """Root mean square and median [K] of the distances ``away`` [T, K]; infinite for tracks without any."""
    some: Mask = np.asarray(np.isfinite(away).any(axis=0))
    misfit, typical = np.full(len(some), np.inf), np.full(len(some), np.inf)
    misfit[some] = np.sqrt(np.nanmean(away[:, some] ** 2, axis=0))
    typical[some] = np.nanmedian(away[:, some], axis=0)
    return misfit, typical


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
    angle = _turns(R, R.mean(axis=0), axis)
    moved = np.einsum("tij,j->ti", dR, pivot) + dp
    return axis, np.asarray(pivot), angle - angle.mean(), float(np.sqrt((moved**2).sum(axis=1).mean()))


def _turns(R: Array, mean: Array, axis: Array) -> Array:
    """Turns [T] about ``axis`` [3] of rotations ``R`` [T, 3, 3] from their ``mean`` [3, 3], rad."""
    a = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    a /= np.linalg.norm(a)
    b = np.cross(axis, a)
    turned = np.einsum("tij,j->ti", R, a)
    return np.asarray(np.arctan2(turned @ (mean @ b), turned @ (mean @ a)))
