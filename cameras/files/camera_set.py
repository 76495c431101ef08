"""Cameras as a file describes them, with the covariance of their parameters if it is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.cameras.calibrate.result import parameter_names
from wingfit.cameras.camera import COEFFICIENTS, Camera
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail, shown

MOST_CAMERAS = 64
LARGEST_PX = 100_000  # along one side of an image
MOST_FOCAL_PX = 1e7
LARGEST_M = 1e4
ROUNDING = 1e-6  # of a rotation matrix
LONGEST_NAME = 100
LEAST_APART_M = 1e-3  # two cameras
LONGEST_READOUT_S = 1.0  # of all rows of an image
MOST_DISTORTED = 1e3  # a term of the distortion at the farthest corner of an image
_POWERS = {"k1": 2, "k2": 4, "k3": 6, "k4": 2, "k5": 4, "k6": 6, "p1": 1, "p2": 1}


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


def rotation_of(vector: Float[Array, 3], where: str) -> Float[Array, "3 3"]:
    """Return the rotation matrix of a rotation ``vector`` (rad); DatasetError for more than one turn."""
    angle = float(np.linalg.norm(vector))
    if angle > 2 * np.pi:
        message = f"a turn by {angle:.4g} rad; at most {2 * np.pi:.4g}: state the rotation vector in radians"
        raise fail(where, f"{angle:.4g}", message)
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def check_cameras(where: str, found: CameraSet) -> CameraSet:
    """Return ``found``; DatasetError if a number of a camera cannot be right, or names are repeated."""
    names = [camera.name for camera in found.cameras]
    if not 1 <= len(names) <= MOST_CAMERAS:
        raise fail(where, len(names), f"{len(names)} cameras; from 1 to {MOST_CAMERAS} are read")
    if len(set(names)) < len(names) or not all(names):
        raise fail(where, ", ".join(names), "two cameras have the same name, or one has none; give each a name")
    for camera in found.cameras:
        if len(camera.name) > LONGEST_NAME or not camera.name.isprintable():
            message = f"{shown(camera.name)} is no name; give one line of at most {LONGEST_NAME} characters"
            raise fail(where, camera.name, message)
        _check_camera(f"{where}, camera {camera.name}", camera)
    _check_apart(where, found.cameras)
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
    if not all(-LARGEST_PX <= value <= 2 * LARGEST_PX for value in camera.matrix[:2, 2]):
        centre = "{:g}, {:g}".format(*camera.matrix[:2, 2])
        raise fail(where, centre, f"principal point {centre} px; it must lie in [-{LARGEST_PX}, {2 * LARGEST_PX}] px")
    for value in np.diag(camera.matrix)[:2]:
        if not 0 < value <= MOST_FOCAL_PX:
            raise fail(where, value, f"focal length {value:g} px; it must lie in (0, {MOST_FOCAL_PX:g}] px")
    _check_lens(where, camera)
    if np.abs(camera.rotation @ camera.rotation.T - np.eye(3)).max() > ROUNDING or np.linalg.det(camera.rotation) < 0:
        raise fail(where, None, "the rotation is no rotation matrix (orthogonal, determinant 1); calibrate again")
    distance = float(np.linalg.norm(camera.translation))
    if distance > LARGEST_M:
        message = f"the origin is {distance:g} m from the camera, at most {LARGEST_M:g} m: check the unit of length"
        raise fail(where, f"{distance:g}", message)
    if camera.row_s < 0:
        raise fail(where, camera.row_s, f"time between rows {camera.row_s:g} s; it must be 0 (global shutter) or more")
    if camera.row_s * height > LONGEST_READOUT_S:
        message = (
            f"{camera.row_s * 1e6:g} us from row to row make {camera.row_s * height:g} s for {height} rows; at most "
            f"{LONGEST_READOUT_S:g} s: state row_us in microseconds"
        )
        raise fail(where, f"{camera.row_s * 1e6:g}", message)


def _check_lens(where: str, camera: Camera) -> None:
    across, down = (
        np.abs(np.array([0, side - 1]) - centre).max() / focal
        for side, centre, focal in zip(camera.size_px, camera.matrix[:2, 2], np.diag(camera.matrix), strict=False)
    )
    radius = float(np.hypot(across, down))
    fisheye = camera.lens.model == "fisheye"
    for name, value in zip(COEFFICIENTS[camera.lens.model], camera.lens.coefficients, strict=True):
        power = 2 * int(name[1:]) if fisheye else _POWERS[name]
        term = abs(value) * (np.arctan(radius) if fisheye else radius) ** power
        if not term <= MOST_DISTORTED:
            message = (
                f"the lens has {name} = {value:g}, which moves a corner of the image by {term:.2g} times its distance "
                f"from the centre; at most {MOST_DISTORTED:g}: calibrate again"
            )
            raise fail(where, f"{value:g}", message)


def _check_apart(where: str, cameras: Sequence[Camera]) -> None:
    """Raise DatasetError if two cameras have one place, from where they see no depth."""
    for one, other in combinations(cameras, 2):
        apart = float(np.linalg.norm(one.centre - other.centre))
        if apart < LEAST_APART_M:
            message = (
                f"the cameras {one.name} and {other.name} are {1e3 * apart:.3g} mm apart; at least "
                f"{1e3 * LEAST_APART_M:g} mm: check the unit of length, and that each camera has images of its own"
            )
            raise fail(where, f"{1e3 * apart:.3g} mm", message)


def _check_covariance(where: str, covariance: Array, count: int) -> None:
    if covariance.shape != (count, count):
        shape = " x ".join(map(str, covariance.shape))
        raise fail(where, shape, f"{shape} numbers; the cameras have {count} parameters: write the file again")
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0))
    if not np.isfinite(covariance).all() or (np.diag(covariance) < 0).any():
        raise fail(where, None, "a number is not finite, or a variance negative; calibrate again")
    if (np.abs(covariance) > np.outer(deviations, deviations) * (1 + 1e-9)).any():
        raise fail(where, None, "a covariance is larger than its variances allow; calibrate again")
