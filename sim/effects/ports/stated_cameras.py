"""The cameras that a dataset states: images of points, and points from images that a fault has changed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.records import CameraPose
from wingfit.records.array_types import Array

Image = tuple[Array, Array]

_ROUNDS = 5  # each about squares the relative error, from at most a few tenths


def image(camera: CameraPose, points: Array) -> Image:
    """Return the image coordinates (u to the right, v down) [...] of ``points`` [..., 3] (m) in ``camera``.

    Coordinates are in focal lengths from the principal point, as a pinhole sees them.
    """
    right, down, forward = _seen(camera, points)
    return right / forward, down / forward


def triangulated(cameras: Sequence[CameraPose], images: Sequence[Image], near: Array) -> Array:
    """Return the points [..., 3] (m) with the ``images`` (u, v) [...] in two cameras or more, a pair for each.

    Where rays do not meet, it is the point with the least sum of squared errors in pixels (Hartley and Zisserman 2004,
    Multiple View Geometry, ch. 12), as a tracker triangulates. It is found by Gauss-Newton from the points ``near``
    [..., 3]. Sums are written out: a matrix product may round differently in a batch of another size.
    """
    points = near
    scale = sum(camera.focal_px for camera in cameras) / len(cameras)
    for _ in range(_ROUNDS):
        # The upper triangle of the normal matrix, row by row, and the right-hand side.
        xx, xy, xz, yy, yz, zz, x, y, z = (0.0 * points[..., 0] for _ in range(9))
        for camera, wanted in zip(cameras, images, strict=True):
            forward, weight = _seen(camera, points)[2], (camera.focal_px / scale) ** 2
            for axis, (value, target) in enumerate(zip(image(camera, points), wanted, strict=True)):
                a, b, c = (
                    (along - value * ahead) / forward
                    for along, ahead in zip(camera.rotation[axis], camera.rotation[2], strict=True)
                )
                error = weight * (target - value)
                xx, xy, xz = xx + weight * a * a, xy + weight * a * b, xz + weight * a * c
                yy, yz, zz = yy + weight * b * b, yz + weight * b * c, zz + weight * c * c
                x, y, z = x + error * a, y + error * b, z + error * c
        points = points + _solved(xx, xy, xz, yy, yz, zz, x, y, z)
    return points


def _seen(camera: CameraPose, points: Array) -> tuple[Array, Array, Array]:
    """Return the coordinates [...] of ``points`` [..., 3] in the camera's axes: right, down, forward (m)."""
    x, y, z = (points[..., k] - camera.centre[k] for k in range(3))
    right, down, forward = (row[0] * x + row[1] * y + row[2] * z for row in camera.rotation)
    return right, down, forward


def _solved(xx: Array, xy: Array, xz: Array, yy: Array, yz: Array, zz: Array, x: Array, y: Array, z: Array) -> Array:
    """Solve the symmetric systems of three equations [...] by Cramer's rule; the result is [..., 3]."""
    one, two, three = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    four, five, six = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    size = xx * one + xy * two + xz * three
    solved = (one * x + two * y + three * z, two * x + four * y + five * z, three * x + five * y + six * z)
    return np.stack(solved, axis=-1) / size[..., None]
