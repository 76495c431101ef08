"""Model of ``cameras:`` in ``dataset.yaml``, and what must hold between cameras and wing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal
from typing import Annotated

import numpy as np
from pydantic import Field

from wingfit.records.array_types import Array, Float
from wingfit.records.description import fields
from wingfit.records.description.quantity import limits
from wingfit.records.description.yaml_text import Path
from wingfit.records.series_checks import used_twice

LEAST_CAMERAS, MOST_CAMERAS = 2, 8
ROUNDING = 1e-5  # of the products of the rows of a rotation
LEAST_DEPTH = 0.01  # m

_Place = Annotated[Decimal, limits("[-1000, 1000] m", "coordinate in the frame of the tracks", fields.METRES)]
_Part = Annotated[Decimal, limits("[-1, 1]", "component of a unit vector in the frame of the tracks")]
_Focal = Annotated[Decimal, limits("(0, 1e7] px", "focal length", "give pixels, as in the matrix of the camera")]
_Axis = Annotated[list[_Part], Field(min_length=3, max_length=3)]


class CameraFile(fields.Strict):
    """A camera that filmed the recordings: place, axes and focal length, as ``wingfit align --cameras`` prints them."""

    name: fields.Name
    centre_m: Annotated[list[_Place], Field(min_length=3, max_length=3)]
    rotation: Annotated[list[_Axis], Field(min_length=3, max_length=3)] = Field(
        description="rows: directions to the right and down in the image, and forward, in the frame of the tracks"
    )
    focal_px: _Focal


LEAST_APART = 0.001  # m, between two cameras: those at one place do not see depth


def faults_of_cameras(
    cameras: Sequence[CameraFile], markers: Sequence[tuple[str, Float[Array, " 3"]]]
) -> Iterator[tuple[Path, object, str]]:
    """Yield path, value and message of each fault of ``cameras`` that filmed ``markers`` (name, rest place in m)."""
    names = [camera.name for camera in cameras]
    for index, camera in enumerate(cameras):
        here: Path = ("cameras", index)
        if camera.name in names[:index]:
            yield (*here, "name"), camera.name, used_twice(camera.name)
        centre = np.array(camera.centre_m, float)
        for other in cameras[:index]:
            apart = float(np.linalg.norm(centre - np.array(other.centre_m, float)))
            if apart < LEAST_APART:
                message = (
                    f"camera {camera.name!r} is {apart:.2g} m from {other.name!r}; two cameras that see depth are at "
                    f"least {LEAST_APART:g} m apart: check centre_m, or remove one"
                )
                yield (*here, "centre_m"), camera.name, message
        axes = np.array(camera.rotation, float)
        worst = float(np.abs(axes @ axes.T - np.eye(3)).max())
        if worst > ROUNDING:
            message = (
                f"has rows that are not unit vectors at right angles: a product of two is wrong by {worst:.2g}, at "
                f"most {ROUNDING:g} is accepted: copy it with seven digits, as wingfit align --cameras prints it"
            )
            yield (*here, "rotation"), None, message
            continue
        if np.linalg.det(axes) * np.linalg.det(np.array(cameras[0].rotation, float)) < 0:
            message = (
                f"is mirrored against that of {names[0]!r}: rows are right, down, forward in all cameras; change a sign"
            )
            yield (*here, "rotation"), None, message
        yield from _too_near(here, camera, axes[2], markers)


def _too_near(
    here: Path, camera: CameraFile, forward: Array, markers: Sequence[tuple[str, Float[Array, " 3"]]]
) -> Iterator[tuple[Path, object, str]]:
    """Yield a fault if a marker at rest is not clearly in front of the ``camera``."""
    depths = [float((place - np.array(camera.centre_m, float)) @ forward) for _, place in markers]
    nearest = int(np.argmin(depths))
    if depths[nearest] < LEAST_DEPTH:
        where = f"{-depths[nearest]:.3g} m behind" if depths[nearest] < 0 else f"{depths[nearest]:.3g} m in front of"
        message = (
            f"camera {camera.name!r} cannot see marker {markers[nearest][0]!r}, which at rest is {where} it; at "
            f"least {LEAST_DEPTH:g} m in front is accepted: check centre_m (m, in the frame of the tracks) and "
            "rotation (rows: right, down, forward)"
        )
        yield (*here, "centre_m"), camera.name, message
