"""Unlabelled points in space at one instant: every pair of detections in two cameras whose rays meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.markers.detections import Detections
from wingfit.cameras.triangulation import Points, triangulate
from wingfit.records.array_types import Array, Float, Index, Mask

_MOST_POINTS = 20_000


@dataclass(frozen=True, eq=False)
class Cloud:
    """Possible points at one instant.

    Attributes:
        points: triangulated, M of them; a detection may belong to several.
        detections: [C, M], index of the detection in each camera, -1 for a camera that does not see the point.
        edges: [C, M, 2], directions (rad) of the edges in each image (:class:`Detections`); NaN if unknown.
    """

    points: Points
    detections: Index
    edges: Float[Array, "C M 2"]

    def __len__(self) -> int:
        return int(self.detections.shape[1])

    @property
    def positions(self) -> Float[Array, "M 3"]:
        """Return the places of the points (m)."""
        return self.points.positions


def possible_points(
    cameras: Sequence[Camera], seen: Sequence[Detections], tolerance_px: float, depth: tuple[float, float]
) -> Cloud:
    """Return the points that detections of two or more cameras agree on, within ``depth`` (m) of each camera.

    ``tolerance_px`` is the error of the calibration (standard deviation), which the misfit of a point allows beside the
    noise of the detections.
    """
    rows: list[Index] = []
    for one, two in combinations(range(len(cameras)), 2):
        rows.append(_pairs(cameras, seen, (one, two), tolerance_px))
    indices = np.concatenate(rows, axis=1)[:, :_MOST_POINTS]
    points = _triangulated(cameras, seen, indices, tolerance_px)
    good = points.misfit <= _gate(points.freedom)
    for camera in cameras:
        far = camera.depth(np.nan_to_num(points.positions))
        good &= (far > depth[0]) & (far < depth[1])
    cloud = _cloud(_only(points, good), indices[:, good], seen)
    return _with_more_cameras(cameras, seen, cloud, tolerance_px) if len(cameras) > 2 else cloud


def _pairs(cameras: Sequence[Camera], seen: Sequence[Detections], pair: tuple[int, int], tolerance_px: float) -> Index:
    """Return the indices [C, M] of the detections of two cameras whose rays pass each other closely."""
    one, two = pair
    empty = np.full((len(cameras), 0), -1)
    if not len(seen[one]) or not len(seen[two]):
        return empty
    distance, scale = _between_rays(cameras[one], seen[one].pixels, cameras[two], seen[two].pixels)
    reach = np.sqrt(_largest(seen[one])[:, None] + _largest(seen[two])[None, :] + 2 * tolerance_px**2)
    first, second = np.nonzero(distance < 5 * reach * scale)
    indices = np.full((len(cameras), len(first)), -1)
    indices[one], indices[two] = first, second
    return indices


def _largest(seen: Detections) -> Float[Array, " N"]:
    return np.asarray(np.linalg.eigvalsh(seen.covariance)[:, -1])


def _between_rays(one: Camera, first: Array, two: Camera, second: Array) -> tuple[Array, Array]:
    """Return the distances [N, M] (m) between rays of two cameras, and the size (m) of a pixel where they pass."""
    rays = []
    for camera, pixels in ((one, first), (two, second)):
        slopes = camera.rays(pixels)
        ray = np.column_stack([slopes, np.ones(len(slopes))]) @ camera.rotation
        rays.append(ray / np.linalg.norm(ray, axis=1, keepdims=True))
    base = two.centre - one.centre
    normal = np.cross(rays[0][:, None], rays[1][None])
    length = np.maximum(np.linalg.norm(normal, axis=2), 1e-9)
    distance = np.abs(normal @ base) / length
    # Distance along the first ray to where the two are closest.
    along = np.einsum("nmi,nmi->nm", np.cross(np.broadcast_to(base, normal.shape), rays[1][None]), normal) / length**2
    focal = min(float(one.matrix[0, 0]), float(two.matrix[0, 0]))
    return distance, np.maximum(along, 0.0) / focal


def _triangulated(cameras: Sequence[Camera], seen: Sequence[Detections], indices: Index, tolerance_px: float) -> Points:
    count = indices.shape[1]
    pixels = np.full((len(cameras), count, 2), np.nan)
    covariance = np.tile(np.eye(2), (len(cameras), count, 1, 1))
    for camera, (found, index) in enumerate(zip(seen, indices, strict=True)):
        have = index >= 0
        pixels[camera, have] = found.pixels[index[have]]
        covariance[camera, have] = found.covariance[index[have]] + tolerance_px**2 * np.eye(2)
    return triangulate(cameras, pixels, covariance)


def _gate(freedom: Index) -> Float[Array, " M"]:
    """Return the most that a misfit may be: 4 standard deviations of one residual, 99.99 % of several."""
    return np.asarray(16.0 + 4.0 * (freedom - 1))


def _with_more_cameras(
    cameras: Sequence[Camera], seen: Sequence[Detections], cloud: Cloud, tolerance_px: float
) -> Cloud:
    """Add to each point the nearest detection of each further camera, if the point still fits; leave out doubles."""
    indices = cloud.detections.copy()
    for number, camera in enumerate(cameras):
        if not len(seen[number]) or not len(cloud):
            continue
        at = camera.project(cloud.positions)
        apart = np.linalg.norm(at[:, None] - seen[number].pixels[None], axis=2)
        nearest = apart.argmin(1)
        reach = 5 * np.sqrt(_largest(seen[number])[nearest] + 2 * tolerance_px**2) + 1.0
        free = (indices[number] < 0) & (apart[np.arange(len(at)), nearest] < 3 * reach)
        tried = indices.copy()
        tried[number, free] = nearest[free]
        points = _triangulated(cameras, seen, tried, tolerance_px)
        better = free & (points.misfit <= _gate(points.freedom))
        indices[:, better] = tried[:, better]
    unique = np.unique(indices, axis=1)
    return _cloud(_triangulated(cameras, seen, unique, tolerance_px), unique, seen)


def _cloud(points: Points, detections: Index, seen: Sequence[Detections]) -> Cloud:
    edges = np.full((*detections.shape, 2), np.nan)
    for own, index, into in zip(seen, detections, edges, strict=True):
        into[index >= 0] = own.edges[index[index >= 0]]
    return Cloud(points, detections, edges)


def _only(points: Points, keep: Mask) -> Points:
    return Points(points.positions[keep], points.covariance[keep], points.misfit[keep], points.freedom[keep])
