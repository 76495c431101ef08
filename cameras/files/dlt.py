"""Cameras from the 11 coefficients of the direct linear transformation, as DLTdv, easyWand and Argus write them.

The coefficients L1 to L11 of Abdel-Aziz and Karara (1971) give u = (L1 X + L2 Y + L3 Z + L4) / (L9 X + L10 Y + L11 Z +
1), and v with L5 to L8. The file has 11 rows and one column for each camera. Programs count pixels differently:

``lower-left``: (1, 1) is the centre of the lower left pixel, and v counts upwards. DLTdv up to version 7 and DLTcal
up to 5 show images upside down for that reason; Argus has the same direction.
``upper-left``: (1, 1) is the centre of the upper left pixel, and v counts downwards, as in MATLAB and in DLTdv 8.
``opencv``: (0, 0) is the centre of the upper left pixel.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import scipy

from wingfit.cameras.calibrate.bundle import moved_camera
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.files.camera_set import CameraSet, check_cameras
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import decode, fail

DltOrigin = Literal["lower-left", "upper-left", "opencv"]
COEFFICIENT_COUNT = 11
MOST_SKEW = 0.05  # of the focal length
MOST_ASPECT = 1.1  # of the two focal lengths
LEAST_RANK = 1e-9  # of singular values, over the largest coefficient
SAMPLES = 7  # along each side of the image, and in depth
DEPTHS = (0.8, 1.2)  # of the samples, over the distance of the origin


def read_dlt(raw: bytes, file: str, sizes_px: Sequence[tuple[int, int]], origin: DltOrigin, metres: float) -> CameraSet:
    """Return the cameras in the contents ``raw`` of ``file``.

    Args:
        raw: comma-separated numbers, 11 rows, one column for each camera.
        file: its name, for messages and for the names of the cameras.
        sizes_px: width and height of the images of each camera, or one for all.
        origin: how pixels are counted (see the module).
        metres: length of the unit of the coefficients (m).

    The notes give for each camera the RMS difference (px) between its coefficients and a camera without skew.
    """
    if origin not in get_args(DltOrigin):
        raise fail(file, origin, f"{origin!r} is no origin of pixels; choose one of {', '.join(get_args(DltOrigin))}")
    table = _table(raw, file)
    count = table.shape[1]
    if len(sizes_px) not in (1, count):
        raise fail(
            file, len(sizes_px), f"{len(sizes_px)} sizes of images for {count} cameras; give one, or one for each"
        )
    sizes = tuple(sizes_px) * (count if len(sizes_px) == 1 else 1)
    cameras, notes, behind = [], [], []
    for i, size in enumerate(sizes):
        name = f"camera {i + 1}"
        matrix = projection_matrix(table[:, i], size, origin, metres)
        camera = camera_of_matrix(f"{file}, {name}", name, matrix, size)
        camera, rms = without_skew(camera, matrix)
        cameras.append(camera)
        behind.append(camera.translation[2] <= 0)
        notes.append(f"{name}: a camera without skew differs by {rms:.3g} px RMS from the coefficients")
    if all(behind):
        message = (
            f"the origin of space lies behind all cameras if pixels are counted from {origin}: images are probably "
            "counted from another corner; state the other origin"
        )
        raise fail(file, origin, message)
    notes.append(f"pixels are counted as {origin}; distortion is not in this format, and is taken as none")
    return check_cameras(file, CameraSet(tuple(cameras), None, tuple(notes)))


def projection_matrix(
    coefficients: Float[Array, 11], size: tuple[int, int], origin: DltOrigin, metres: float
) -> Float[Array, "3 4"]:
    """Return the matrix from points (m) to pixels of this package, for ``coefficients`` in units of ``metres``."""
    matrix = np.append(coefficients, 1.0).reshape(3, 4)
    matrix = matrix / np.array([metres, metres, metres, 1.0])
    to_ours = {
        "lower-left": [[1, 0, -1], [0, -1, size[1]], [0, 0, 1]],
        "upper-left": [[1, 0, -1], [0, 1, -1], [0, 0, 1]],
        "opencv": np.eye(3),
    }
    return np.asarray(np.array(to_ours[origin], dtype=float) @ matrix)


def camera_of_matrix(where: str, name: str, matrix: Float[Array, "3 4"], size: tuple[int, int]) -> Camera:
    """Decompose the projection ``matrix`` into a camera; its skew is dropped.

    See Hartley and Zisserman (2004), "Multiple view geometry in computer vision", section 6.2.4.

    DatasetError if the skew or the ratio of focal lengths is not that of a camera.
    """
    left = matrix[:, :3]
    if not np.isfinite(matrix).all() or np.linalg.matrix_rank(left, tol=LEAST_RANK * np.abs(left).max()) < 3:
        message = "the coefficients are not those of a camera (their matrix is singular); calibrate again"
        raise fail(where, None, message)
    inner, rotation = scipy.linalg.rq(left)
    signs = np.diag(np.sign(np.diag(inner)))
    inner, rotation = inner @ signs, signs @ rotation
    # The matrix is known up to its sign, which makes the axes of the camera right-handed.
    sign = np.sign(np.linalg.det(rotation))
    translation = sign * np.linalg.solve(inner, matrix[:, 3])
    inner = inner / inner[2, 2]
    skew, aspect = inner[0, 1] / inner[0, 0], inner[1, 1] / inner[0, 0]
    if abs(skew) > MOST_SKEW:
        message = f"skew {skew:.3g} of the focal length; at most {MOST_SKEW:g}: digitise the calibration again"
        raise fail(where, f"{skew:.3g}", message)
    if not 1 / MOST_ASPECT < aspect < MOST_ASPECT:
        message = (
            f"focal lengths {inner[0, 0]:.4g} and {inner[1, 1]:.4g} px; their ratio must lie in "
            f"[{1 / MOST_ASPECT:.2f}, {MOST_ASPECT:g}]: digitise the calibration again"
        )
        raise fail(where, f"{aspect:.3g}", message)
    inner[0, 1] = 0.0
    return Camera(name, size, inner, Lens(), sign * rotation, translation)


def without_skew(camera: Camera, matrix: Float[Array, "3 4"]) -> tuple[Camera, float]:
    """Return the camera without skew that is nearest to the projection ``matrix``, and the RMS difference (px).

    The start is ``camera``. Points all over the image, at 0.8 to 1.2 times the distance of the origin, are compared.
    """
    points = _samples(camera)
    ends = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    wanted = ends[:, :2] / ends[:, 2:]
    for _ in range(20):
        pixels, _, changes = camera.project_with_changes(points)
        columns = changes.reshape(-1, changes.shape[2])
        step = np.linalg.lstsq(
            columns / (size := np.linalg.norm(columns, axis=0)), (wanted - pixels).ravel(), rcond=None
        )[0]
        camera = moved_camera(camera, step / size)
    distances = np.sum((camera.project(points) - wanted) ** 2, axis=1)
    return camera, float(np.sqrt(np.mean(distances)))


def _samples(camera: Camera) -> Array:
    """Return points (m) that appear all over the image of ``camera``, at several depths."""
    across, down = (np.linspace(0, side - 1, SAMPLES) for side in camera.size_px)
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    rays = np.column_stack([camera.rays(pixels), np.ones(len(pixels))])
    distance = float(np.linalg.norm(camera.translation))
    places = np.concatenate([rays * depth for depth in distance * np.linspace(*DEPTHS, SAMPLES)])
    return np.asarray((places - camera.translation) @ camera.rotation)


def _table(raw: bytes, file: str) -> Array:
    """Return the numbers [11, C] in ``raw``."""
    rows = [row for row in csv.reader(io.StringIO(decode(raw, file))) if any(cell.strip() for cell in row)]
    if len(rows) != COEFFICIENT_COUNT or len({len(row) for row in rows}) != 1:
        message = f"{len(rows)} rows; 11 rows with one number for each camera are read: save the DLT coefficients alone"
        raise fail(file, len(rows), message)
    table = np.empty((COEFFICIENT_COUNT, len(rows[0])))
    for i, row in enumerate(rows):
        for j, cell in enumerate(row):
            try:
                table[i, j] = float(cell)
            except ValueError:
                table[i, j] = np.nan
            if not np.isfinite(table[i, j]):
                raise fail(
                    f"{file}, line {i + 1}, column {j + 1}", cell, f"{cell!r} is no finite number; give L{i + 1}"
                )
    return table
