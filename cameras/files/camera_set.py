"""Cameras as a file describes them, with the covariance of their parameters if it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.cameras.calibrate.result import parameter_names
from wingfit.cameras.camera import Camera
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail

MOST_CAMERAS = 64
LARGEST_PX = 100_000  # along one side of an image
MOST_FOCAL_PX = 1e7
LARGEST_M = 1e4
ROUNDING = 1e-6  # of a rotation matrix


@dataclass(frozen=True, eq=False)
class CameraSet:
    """Cameras of one space.

    Attributes:
        cameras: with different names.
        covariance: of all parameters, camera after camera, in the order of ``Camera.parameter_names``; None if unknown.
        notes: what the reader of the file assumed, changed or did not read.
    """

    cameras: tuple[Camera, ...]
    covariance: Float[Array, "P P"] | None = None
    notes: tuple[str, ...] = ()

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the names of the rows of ``covariance``."""
        return parameter_names(self.cameras)


def check_cameras(where: str, found: CameraSet) -> CameraSet:
    """Return ``found``; DatasetError if a number of a camera cannot be right, or names are repeated."""
    names = [camera.name for camera in found.cameras]
    if not 1 <= len(names) <= MOST_CAMERAS:
        raise fail(where, len(names), f"{len(names)} cameras; from 1 to {MOST_CAMERAS} are read")
    if len(set(names)) < len(names) or not all(names):
        raise fail(where, ", ".join(names), "two cameras have the same name, or one has none; give each a name")
    for camera in found.cameras:
        _check_camera(f"{where}, camera {camera.name}", camera)
    if found.covariance is not None:
        _check_covariance(f"{where}, covariance", found.covariance, len(found.parameters))
    return found


def _check_camera(where: str, camera: Camera) -> None:
    width, height = camera.size_px
    if not (0 < width <= LARGEST_PX and 0 < height <= LARGEST_PX):
        raise fail(where, f"{width} x {height}", f"size {width} x {height} px; each must lie in [1, {LARGEST_PX}] px")
    numbers = (camera.matrix, camera.lens.coefficients, camera.rotation, camera.translation, camera.row_s)
    if not all(np.isfinite(one).all() for one in numbers):
        raise fail(where, "nan", "a number is not finite; calibrate the camera again")
    for value in np.diag(camera.matrix)[:2]:
        if not 0 < value <= MOST_FOCAL_PX:
            raise fail(where, value, f"focal length {value:g} px; it must lie in (0, {MOST_FOCAL_PX:g}] px")
    if np.abs(camera.rotation @ camera.rotation.T - np.eye(3)).max() > ROUNDING or np.linalg.det(camera.rotation) < 0:
        raise fail(where, None, "the rotation is no rotation matrix (orthogonal, determinant 1); calibrate again")
    distance = float(np.linalg.norm(camera.translation))
    if distance > LARGEST_M:
        message = f"the origin is {distance:g} m from the camera, at most {LARGEST_M:g} m: check the unit of length"
        raise fail(where, f"{distance:g}", message)
    if camera.row_s < 0:
        raise fail(where, camera.row_s, f"time between rows {camera.row_s:g} s; it must be 0 (global shutter) or more")


def _check_covariance(where: str, covariance: Array, count: int) -> None:
    if covariance.shape != (count, count):
        shape = " x ".join(map(str, covariance.shape))
        raise fail(where, shape, f"{shape} numbers; the cameras have {count} parameters: write the file again")
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0))
    if not np.isfinite(covariance).all() or (np.diag(covariance) < 0).any():
        raise fail(where, None, "a number is not finite, or a variance negative; calibrate again")
    if (np.abs(covariance) > np.outer(deviations, deviations) * (1 + 1e-9)).any():
        raise fail(where, None, "a covariance is larger than its variances allow; calibrate again")
