"""Points in space from their pixels in several cameras, with covariances (Hartley and Zisserman 2004, chapter 12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.records.array_types import Array, Float, Index, Mask

LEAST_CAMERAS = 2
_STEPS = 10
_SMALL_STEP_M = 1e-9
_BLOCK = 16_384  # points that are computed at once; a multiple of the rows that BLAS computes at once


@dataclass(frozen=True, eq=False)
class Points:
    """Triangulated points.

    Attributes:
        positions: [N, 3] (m); NaN where fewer than two cameras see the point, or their rays do not meet before them.
        covariance: [N, 3, 3] (m^2), of the pixels' covariances.
        misfit: [N], sum over cameras of squared residuals over the pixels' covariances; chi-square with
            ``2 * cameras - 3`` degrees of freedom.
        freedom: [N], these degrees of freedom.
    """

    positions: Float[Array, "N 3"]
    covariance: Float[Array, "N 3 3"]
    misfit: Float[Array, " N"]
    freedom: Index


def triangulate(
    cameras: Sequence[Camera], pixels: Float[Array, "C N 2"], covariance: Float[Array, "C N 2 2"]
) -> Points:
    """Return the points in space whose pixels in ``cameras`` are given; NaN where a camera does not see one.

    From the points nearest to the rays, then Gauss-Newton on the pixels, weighted by the inverse of ``covariance``.
    """
    seen = np.asarray(np.isfinite(pixels).all(2))
    count = pixels.shape[1]
    start = np.full((count, 3), np.nan)
    for block in blocks(count):
        start[block] = nearest_points(cameras, pixels[:, block])
    positions = np.full((count, 3), np.nan)
    spread = np.full((count, 3, 3), np.nan)
    misfit = np.full(count, np.nan)
    at = np.flatnonzero(np.isfinite(start).all(1))
    if len(at):
        positions[at], matrix, misfit[at] = _refined(cameras, pixels, covariance, seen, at, start[at])
        for block in blocks(len(at)):
            spread[at[block]] = np.linalg.inv(matrix[block])
    return Points(positions, spread, misfit, 2 * seen.sum(0) - 3)


def blocks(count: int) -> list[slice]:
    """Return the slices of ``count`` points that are computed one after the other, so that memory is bounded."""
    return [slice(first, min(first + _BLOCK, count)) for first in range(0, count, _BLOCK)]


def nearest_points(cameras: Sequence[Camera], pixels: Float[Array, "C N 2"]) -> Float[Array, "N 3"]:
    """Return the points (m) nearest to the rays of all ``cameras`` at ``pixels``.

    NaN where fewer than two cameras see a point (NaN pixels), where rays are parallel, and where the point is not in
    front of the cameras.
    """
    count = pixels.shape[1]
    matrix, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    seen = np.asarray(np.isfinite(pixels).all(axis=2))
    for camera, own, mine in zip(cameras, pixels, seen, strict=True):
        rays = np.concatenate([camera.rays(own[mine]), np.ones((int(mine.sum()), 1))], axis=1)
        rays = rays @ camera.rotation
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        # The projection on the plane across the ray measures the distance from it.
        across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
        matrix[mine] += across
        right[mine] += across @ camera.centre
    points = np.full((count, 3), np.nan)
    enough = seen.sum(axis=0) >= LEAST_CAMERAS
    enough[enough] = np.linalg.cond(matrix[enough]) < 1e12
    points[enough] = np.linalg.solve(matrix[enough], right[enough][:, :, None])[:, :, 0]
    for camera, mine in zip(cameras, seen, strict=True):
        behind = mine & enough
        behind[behind] = camera.depth(points[behind]) <= 0
        points[behind] = np.nan
    return points


def _weights(covariance: Float[Array, "C N 2 2"], seen: Mask) -> Float[Array, "C N 2 2"]:
    weights = np.zeros_like(covariance)
    weights[seen] = np.linalg.inv(covariance[seen])
    return weights


def _refined(
    cameras: Sequence[Camera], pixels: Array, covariance: Array, seen: Mask, at: Index, start: Float[Array, "N 3"]
) -> tuple[Float[Array, "N 3"], Float[Array, "N 3 3"], Float[Array, " N"]]:
    """Return the points with the numbers ``at``, their matrices of information and the sums of weighted squares.

    All take the same number of steps, so that the blocks do not change the result.
    """
    points, step = start, np.empty_like(start)
    matrix, cost = np.empty((len(at), 3, 3)), np.empty(len(at))
    weights = np.empty((len(cameras), len(at), 2, 2))
    for block in blocks(len(at)):
        weights[:, block] = _weights(covariance[:, at[block]], seen[:, at[block]])
    for _ in range(_STEPS):
        for block in blocks(len(at)):
            of = at[block]
            matrix[block], right, cost[block] = _linear(
                cameras, pixels[:, of], seen[:, of], weights[:, block], points[block]
            )
            step[block] = np.linalg.solve(matrix[block], right[:, :, None])[:, :, 0]
        # The information and the cost are those of the points before a step too small to change them.
        if np.abs(step).max() < _SMALL_STEP_M:
            break
        points = points + step
    return points, matrix, cost


def _linear(
    cameras: Sequence[Camera], pixels: Array, seen: Mask, weights: Array, points: Float[Array, "N 3"]
) -> tuple[Float[Array, "N 3 3"], Float[Array, "N 3"], Float[Array, " N"]]:
    """Return the normal equations at ``points``, matrix and right side, and the sums of weighted squares."""
    matrix, right, cost = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3)), np.zeros(len(points))
    for camera, at, mask, weight in zip(cameras, pixels, seen, weights, strict=True):
        where, by_point, _ = camera.project_with_changes(points[mask])
        residual = at[mask] - where
        weighted = np.einsum("nij,nik->njk", weight[mask], by_point)
        matrix[mask] += np.einsum("nij,nik->njk", by_point, weighted)
        right[mask] += np.einsum("nij,ni->nj", weighted, residual)
        cost[mask] += np.einsum("ni,nij,nj->n", residual, weight[mask], residual)
    return matrix, right, cost


def error_from_cameras(
    cameras: Sequence[Camera],
    points: Points,
    pixels: Float[Array, "C N 2"],
    covariance: Float[Array, "C N 2 2"],
    calibration: Float[Array, "P P"],
) -> Float[Array, "N 3 P"]:
    """Return the derivatives of the ``points`` by all parameters of the cameras, in the order of ``calibration``.

    A wrong calibration moves all points together: their covariance from it is ``J calibration J^T`` between any two.
    """
    seen = np.asarray(np.isfinite(pixels).all(2))
    weights = _weights(covariance, seen)
    total = len(calibration)
    right = np.zeros((pixels.shape[1], 3, total))
    first = 0
    for camera, mask, weight in zip(cameras, seen, weights, strict=True):
        size = len(camera.parameter_names)
        good = mask & np.isfinite(points.positions).all(1)
        _, by_point, by_camera = camera.project_with_changes(points.positions[good])
        right[good, :, first : first + size] -= np.einsum("nij,nik,nkp->njp", by_point, weight[good], by_camera)
        first += size
    return np.asarray(np.einsum("nij,njp->nip", points.covariance, right))
