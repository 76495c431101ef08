"""Points in space from pixels in several cameras: by the nearest point to all rays, then by least squares of pixels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.cameras.calibrate.bundle import BODY_MOTIONS, Free, Observations, Scene, adjust
from wingfit.cameras.camera import Camera
from wingfit.records.array_types import Array, Float

LEAST_CAMERAS = 2


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


def triangulate(cameras: Sequence[Camera], pixels: Float[Array, "C N 2"]) -> Float[Array, "N 3"]:
    """Return the points (m) with the least squared errors of ``pixels``; NaN as in :func:`nearest_points`."""
    start = nearest_points(cameras, pixels)
    chosen = np.nonzero(np.isfinite(start).all(axis=1))[0]
    if not len(chosen):
        return start
    own = pixels[:, chosen]
    camera, body = np.nonzero(np.isfinite(own).all(axis=2))
    seen = Observations(camera, body, np.zeros_like(body), own[camera, body])
    parameters = sum(len(one.parameter_names) for one in cameras)
    motions = np.zeros((len(chosen), BODY_MOTIONS), bool)
    motions[:, 3:] = True
    scene = Scene(tuple(cameras), np.zeros((1, 3)), np.broadcast_to(np.eye(3), (len(chosen), 3, 3)), start[chosen])
    start[chosen] = adjust(scene, seen, Free(np.zeros(parameters, bool), motions)).scene.translations
    return start
