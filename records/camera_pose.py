"""Where the cameras of a recording stood: enough of a calibration to simulate what goes wrong in their images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class CameraPose:
    """Place, orientation and focal length of a camera, as its calibration gives them.

    Attributes:
        name: of the camera.
        centre: centre of projection, m, in the frame of the tracks.
        rotation: rows: the directions to the right and down in the image, and forward along the optical axis, in the
            frame of the tracks. Orthonormal; its determinant is -1 where the tracks are those of a mirrored wing.
        focal_px: focal length, pixels.
    """

    name: str
    centre: Triple
    rotation: tuple[Triple, Triple, Triple]
    focal_px: float

    @classmethod
    def of(cls, name: str, centre: Float[Array, " 3"], rotation: Float[Array, "3 3"], focal_px: float) -> CameraPose:
        """Return the camera with these arrays for its place (m) and its axes."""
        right, down, forward = (_triple(row) for row in np.asarray(rotation))
        return cls(name, _triple(np.asarray(centre)), (right, down, forward), float(focal_px))

    def seen_from(self, rotation: Float[Array, "3 3"], origin: Float[Array, " 3"]) -> CameraPose:
        """Return the camera in a frame in which a point p of this one is (p - origin) @ rotation.T."""
        centre = (np.asarray(self.centre) - origin) @ rotation.T
        return CameraPose.of(self.name, centre, np.asarray(self.rotation) @ rotation.T, self.focal_px)

    def depth(self, point: Float[Array, "... 3"]) -> Float[Array, ...]:
        """Return the distance of points [..., 3] (m) in front of the camera, along its axis; negative behind it."""
        return np.asarray((np.asarray(point) - np.asarray(self.centre)) @ np.asarray(self.rotation[2]))


def _triple(values: Array) -> Triple:
    x, y, z = np.asarray(values, float).tolist()
    return x, y, z
