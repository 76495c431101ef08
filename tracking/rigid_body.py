"""Pose of a rigid body in each frame from its tracked markers, and the derivatives of the pose by every marker."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread

# Markers whose second principal extent is below this fraction of the first count as collinear: no attitude.
_FLAT = 0.02
_OUTLIER = 8.0
_PASSES = 3
_WRONG_SCALE = 1.3  # beyond this ratio of distances between tracks and body file, the units or the markers must differ
_OFF_SCALE = 1.05
_LARGEST = 10.0


@dataclass(frozen=True, eq=False)
class Poses:
    """Pose of a body with M markers in each of T frames; NaN where fewer than 3 markers, or collinear ones, were used.

    Attributes:
        rotation: [T, 3, 3] from body to tracking axes.
        position: [T, 3] of the body's origin in tracking axes, m.
        seen: [T, M] whether a marker was used: seen and no outlier.
        residuals: [T, M, 3] measured minus fitted position of each marker in body axes, m; NaN where not used.
        shape: [M, 3] positions of the markers in body axes, m, refined from the tracks.
        rejected: number of samples excluded as outliers.
    """

    rotation: Array
    position: Array
    seen: Mask
    residuals: Array
    shape: Array
    rejected: int = 0

    @property
    def sensitivity(self) -> Array:
        """Derivative [T, 6, 3 M] of the pose by the markers' displacements (m), all in body axes.

        Rows: displacement of the body's origin (m), then small rotation (rad), of the linearised least-squares fit. NaN
        in frames without a pose.
        """
        M = len(self.shape)
        J = np.zeros((M, 3, 6))
        J[:, :, :3] = np.eye(3)
        J[:, :, 3:] = -cross_matrices(self.shape)
        weighted = np.where(self.seen[:, :, None, None], J, 0.0).reshape(len(self.seen), 3 * M, 6)
        normal = np.swapaxes(weighted, 1, 2) @ weighted
        fitted = np.isfinite(self.position[:, 0])
        result = np.full((len(self.seen), 6, 3 * M), np.nan)
        result[fitted] = np.linalg.solve(normal[fitted], np.swapaxes(weighted[fitted], 1, 2))
        return result


def scale_remarks(tracks: Array, shape: Array) -> list[str]:
    """Check that ``tracks`` [T, M, 3] and ``shape`` [M, 3] (m) have the same scale; return remarks on a difference.

    A remark is made above a factor of 1.05. ValueError above a factor of 1.3, or if ``shape`` spreads over more than
    10 m: the units are wrong.
    """
    size = float(np.linalg.norm(np.ptp(shape, axis=0)))
    if size > _LARGEST:
        raise ValueError(
            f"the markers in the body file spread over {size:.4g} m; it must be at most {_LARGEST:g} m: give metres, "
            "not millimetres or centimetres"
        )
    ratio = _scale(tracks, shape)
    off = max(ratio, 1 / ratio)
    if off > _WRONG_SCALE:
        which, other = ("tracks", "body file") if ratio > 1 else ("body file", "tracks")
        units = {10.0: "decimetres", 100.0: "centimetres", 1000.0: "millimetres"}
        near = [unit for factor, unit in units.items() if factor / _WRONG_SCALE < off < factor * _WRONG_SCALE]
        unknown = f"the {which} or the {other} are in another unit"
        cause = f"that looks like {near[0]} in the {which}" if near else unknown
        raise ValueError(
            f"distances between markers in the tracks are {ratio:.4g} times those in the body file; the ratio must "
            f"be 1 within {100 * (_WRONG_SCALE - 1):.0f} %: {cause}, or the names belong to different markers: give "
            "metres in both"
        )
    remark = f"distances between markers in the tracks are {ratio:.3g} times those in the body file; check the scale"
    return [remark] if off > _OFF_SCALE else []


def _scale(tracks: Array, shape: Array) -> float:
    """Ratio of the distances between markers in ``tracks`` to those in ``shape``; NaN if no two are seen together.

    The median over pairs and frames is used, which is robust to swapped markers.
    """
    first, second = np.triu_indices(len(shape), 1)
    expected = np.linalg.norm(shape[first] - shape[second], axis=-1)
    apart = expected > 0
    seen = np.linalg.norm(tracks[:, first[apart]] - tracks[:, second[apart]], axis=-1) / expected[apart]
    return float(np.median(seen[np.isfinite(seen)])) if np.isfinite(seen).any() else float("nan")


@one_blas_thread
def poses(tracks: Array, shape: Array) -> Poses:
    """Least-squares poses (Arun, Huang and Blostein 1987; Kabsch 1976) of ``tracks`` [T, M, 3], m, NaN where not seen.

    ``shape`` [M, 3] are the markers' positions in body axes, m. It is refined to the mean measured positions, aligned
    with the given ones by least squares, so that an error of the shape does not make the pose jump when a marker
    vanishes. Samples far from the rigid body (swapped markers) are excluded. ValueError if all markers are collinear.
    """
    if np.linalg.matrix_rank(shape - shape.mean(axis=0), tol=_FLAT * float(np.ptp(shape, axis=0).max())) < 2:
        raise ValueError(f"the {len(shape)} markers lie on one line; a pose needs 3 that do not")
    seen: Mask = np.asarray(np.isfinite(tracks).all(axis=-1))
    rejected = 0
    for _ in range(_PASSES):
        found = _refined(tracks, shape, seen)
        outlying = _outlying(found)
        if not outlying.any():
            break
        seen, rejected = np.asarray(seen & ~outlying), rejected + int(outlying.sum())
    else:
        found = _refined(tracks, shape, seen)
    return Poses(found.rotation, found.position, found.seen, found.residuals, found.shape, rejected)


def _refined(tracks: Array, shape: Array, seen: Mask) -> Poses:
    found = _fit(tracks, shape, seen)
    count = np.isfinite(found.residuals).sum(axis=0)
    mean = np.nansum(found.residuals, axis=0) / np.maximum(count, 1)
    rotation, position = _align(shape[None], (shape + mean)[None], np.ones((1, len(shape)), dtype=bool))
    return _fit(tracks, (shape + mean - position[0]) @ rotation[0], seen)


def _fit(tracks: Array, shape: Array, seen: Mask) -> Poses:
    R, p = _align(np.broadcast_to(shape, tracks.shape), tracks, seen)
    back = np.einsum("tji,tmj->tmi", R, tracks - p[:, None, :])
    residuals = np.where(seen[..., None], back - shape, np.nan)
    return Poses(R, p, seen, residuals, shape)


def _align(body: Array, world: Array, seen: Mask) -> tuple[Array, Array]:
    """Rotation [T, 3, 3] and origin [T, 3] of the least-squares rigid map from ``body`` to ``world`` [T, M, 3].

    Only markers in ``seen`` [T, M] count; NaN in frames with fewer than three of them, or with collinear ones.
    """
    w = seen[..., None].astype(np.float64)
    count = np.maximum(w.sum(axis=1), 1.0)
    world = np.where(seen[..., None], world, 0.0)
    b0, p0 = (w * body).sum(axis=1) / count, world.sum(axis=1) / count
    b = w * (body - b0[:, None])
    U, _, Vt = np.linalg.svd(np.swapaxes(b, 1, 2) @ (world - p0[:, None]))
    mirrored = np.linalg.det(U) * np.linalg.det(Vt)
    U[:, :, 2] *= mirrored[:, None]
    R = np.swapaxes(U @ Vt, 1, 2)
    extent = np.linalg.svd(b, compute_uv=False)
    short = (seen.sum(axis=1) < 3) | (extent[:, 1] < _FLAT * extent[:, 0])
    R[short] = np.nan
    return R, p0 - np.einsum("tij,tj->ti", R, b0)


def _outlying(found: Poses) -> Mask:
    """True [T, M] for the marker with the largest residual in its frame, if it is an outlier and four others remain.

    An outlier has a residual above 8 times the median over all frames and markers.
    """
    size = np.linalg.norm(found.residuals, axis=-1)
    usual = float(np.nanmedian(size)) if np.isfinite(size).any() else 0.0
    worst = np.where(np.isfinite(size), size, -1.0)
    far = (worst == worst.max(axis=1, keepdims=True)) & (worst > max(_OUTLIER * usual, 1e-9))
    return np.asarray(far & (found.seen.sum(axis=1) > 4)[:, None])


def cross_matrices(v: Array) -> Array:
    """Matrices [..., 3, 3] of ``v`` [..., 3] such that ``cross_matrices(a) @ b`` is the cross product a x b."""
    return np.cross(np.eye(3), v[..., None, :])


def quaternions(rotation: Array) -> Array:
    """Unit quaternions [T, 4] (w, x, y, z) of ``rotation`` [T, 3, 3], continuous in time; NaN without a pose."""
    q = np.full((len(rotation), 4), np.nan)
    fitted = np.isfinite(rotation[:, 0, 0])
    if fitted.any():
        found = scipy.spatial.transform.Rotation.from_matrix(rotation[fitted]).as_quat(scalar_first=True)
        flips = np.cumprod(np.sign(np.append(1.0, np.sum(found[1:] * found[:-1], axis=1))))
        q[fitted] = found * flips[:, None]
    return q
