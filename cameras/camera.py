"""One calibrated camera: where a point of space appears in its images, and how that changes with each parameter."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from wingfit.cameras.opencv import opencv
from wingfit.records import CameraPose
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail, nearest

LensModel = Literal["pinhole", "brown", "rational", "fisheye"]
COEFFICIENTS: dict[LensModel, tuple[str, ...]] = {
    "pinhole": (),
    "brown": ("k1", "k2", "p1", "p2", "k3"),
    "rational": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}
POSE = ("turn_x", "turn_y", "turn_z", "move_x", "move_y", "move_z")
FOCAL_AND_CENTRE = ("f_x", "f_y", "c_x", "c_y")


@dataclass(frozen=True)
class Lens:
    """Distortion of a lens, with the coefficients of OpenCV in the order of ``COEFFICIENTS``.

    ``brown`` is that of Brown (1971), ``rational`` adds a denominator of three terms, ``fisheye`` is that of Kannala
    and Brandt (2006); ``pinhole`` has none.
    """

    model: LensModel = "pinhole"
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.model not in get_args(LensModel):
            hint = nearest(self.model, COEFFICIENTS)
            raise fail("lens, model", self.model, f"{self.model!r} is no model of a lens; {hint}")
        names, given = COEFFICIENTS[self.model], len(self.coefficients)
        if given != len(names):
            listed = ", ".join(names) or "none"
            raise fail("lens, coefficients", given, f"there are {given}; the model {self.model} has {listed}")


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera: its lens, and its place and orientation.

    Attributes:
        name: of the camera.
        size_px: width and height of its images.
        matrix: [3, 3], focal lengths and principal point (pixels), without skew.
        lens: distortion.
        rotation: [3, 3], from the axes of the space to those of the camera (x right, y down, z forward).
        translation: [3] (m): the origin of the space in the axes of the camera.
        row_s: time from the start of one row to that of the next (s); zero for a global shutter.
    """

    name: str
    size_px: tuple[int, int]
    matrix: Float[Array, "3 3"]
    lens: Lens
    rotation: Float[Array, "3 3"]
    translation: Float[Array, 3]
    row_s: float = field(default=0.0)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Return the names of the columns of the derivatives by the camera's parameters."""
        return (*FOCAL_AND_CENTRE, *COEFFICIENTS[self.lens.model], *POSE)

    @cached_property
    def centre(self) -> Float[Array, 3]:
        """Return the place of the camera in space (m)."""
        return np.asarray(-self.rotation.T @ self.translation)

    @property
    def pose(self) -> CameraPose:
        """Return its place, orientation and mean focal length, which a dataset states."""
        focal = float(np.sqrt(self.matrix[0, 0] * self.matrix[1, 1]))
        return CameraPose.of(self.name, self.centre, self.rotation, focal)

    def depth(self, points: Float[Array, "N 3"]) -> Float[Array, " N"]:
        """Return the distance (m) of ``points`` in front of the camera, along its axis; negative behind it."""
        return np.asarray(points @ self.rotation[2] + self.translation[2])

    def project(self, points: Float[Array, "N 3"]) -> Float[Array, "N 2"]:
        """Return the pixels where ``points`` (m) appear; those behind the camera have no meaning."""
        return self._projected(points)[0]

    def project_with_changes(
        self, points: Float[Array, "N 3"]
    ) -> tuple[Float[Array, "N 2"], Float[Array, "N 2 3"], Float[Array, "N 2 P"]]:
        """Return pixels, their derivatives by ``points`` and those by the parameters in ``parameter_names``.

        A turn (rad) is a rotation vector applied after ``rotation``, a move (m) is added to ``translation``.
        """
        pixels, by_all = self._projected(points)
        lens = len(self.lens.coefficients)
        turned, moved = by_all[:, :, :3], by_all[:, :, 3:6]
        # cv2 orders columns by rotation, translation, focal lengths, centre, distortion.
        inner = by_all[:, :, 6 : 10 + lens]
        return pixels, moved @ self.rotation, np.concatenate([inner, turned, moved], axis=2)

    def rays(self, pixels: Float[Array, "N 2"]) -> Float[Array, "N 2"]:
        """Return x / z and y / z, in the camera's axes, of the rays that appear at ``pixels``; without distortion."""
        cv2 = opencv()
        given = np.ascontiguousarray(pixels, dtype=float).reshape(-1, 1, 2)
        if not len(given):
            return np.empty((0, 2))
        coefficients = np.array(self.lens.coefficients)
        if self.lens.model == "fisheye":
            return np.asarray(cv2.fisheye.undistortPoints(given, self.matrix, coefficients)).reshape(-1, 2)
        exact = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
        found = cv2.undistortPoints(given, self.matrix, coefficients, criteria=exact)
        return np.asarray(found).reshape(-1, 2)

    def _projected(self, points: Float[Array, "N 3"]) -> tuple[Float[Array, "N 2"], Float[Array, "N 2 P"]]:
        """Return pixels and their derivatives by rotation, translation, focal lengths, centre and distortion."""
        cv2 = opencv()
        lens = len(self.lens.coefficients)
        if not len(points):
            return np.empty((0, 2)), np.empty((0, 2, 10 + lens))
        # The rotation is applied here, so that its derivative is that of a small turn after it.
        seen = np.ascontiguousarray(points @ self.rotation.T, dtype=float).reshape(-1, 1, 3)
        still, coefficients = np.zeros(3), np.array(self.lens.coefficients)
        if self.lens.model == "fisheye":
            pixels, changes = cv2.fisheye.projectPoints(seen, still, self.translation, self.matrix, coefficients)
            # fisheye orders columns by focal lengths, centre, distortion, rotation, translation, skew.
            order = [*range(8, 14), *range(8)]
            changes = np.asarray(changes)[:, order]
        else:
            pixels, changes = cv2.projectPoints(seen, still, self.translation, self.matrix, coefficients)[:2]
            changes = np.asarray(changes)[:, : 10 + lens]
        return np.asarray(pixels).reshape(-1, 2), changes.reshape(len(seen), 2, 10 + lens)
