"""Cameras from OpenCV's FileStorage, YAML or XML: one camera, or the pair of OpenCV's stereo sample."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from wingfit.cameras.camera import COEFFICIENTS, Camera, Lens, LensModel
from wingfit.cameras.files.camera_set import LARGEST_PX, ROUNDING, CameraSet, check_cameras
from wingfit.cameras.opencv import opencv
from wingfit.records.array_types import Array
from wingfit.records.errors import check_most, fail
from wingfit.records.limits import MIB

MOST_BYTES = 16 * MIB
MOST_NESTED = 32  # of the maps, lists and elements of a file
MOST_SKEW = 1e-9  # of the focal length
_NESTING = re.compile(rb"[\[{]|[\]}]|<[A-Za-z_][^>]*(?<!/)>|</")
# Numbers of coefficients that OpenCV writes, and the model of this package that has the first of them.
MODELS: dict[int, LensModel] = {0: "pinhole", 4: "brown", 5: "brown", 8: "rational", 12: "rational", 14: "rational"}


def read_opencv(
    raw: bytes,
    file: str,
    *,
    metres: float | None,
    size_px: tuple[int, int] | None = None,
    extrinsics: bytes | None = None,
) -> CameraSet:
    """Return the cameras in the contents ``raw`` of ``file``.

    Args:
        raw: ``camera_matrix`` and ``distortion_coefficients`` of one camera, which gets the axes of space; or ``M1``,
            ``D1``, ``M2``, ``D2`` and, here or in ``extrinsics``, ``R`` and ``T`` of two, with the axes of the first.
        file: its name, for messages.
        metres: length of the unit of ``T`` (m), that of the squares of the board; not needed for one camera.
        size_px: width and height of the images, if the file does not state them.
        extrinsics: contents of the second file of a stereo calibration.
    """
    stored = _stored(raw, file)
    size = _size(stored, file, size_px)
    if _matrix(stored, "camera_matrix") is not None:
        fisheye = bool(stored.getNode("fisheye_model").real()) if not stored.getNode("fisheye_model").empty() else False
        parts = _inner(stored, "camera_matrix", "distortion_coefficients", file, fisheye)
        camera = Camera("camera", size, *parts, np.eye(3), np.zeros(3))
        return check_cameras(file, CameraSet((camera,), None, ("the axes of the camera are those of space",)))
    if _matrix(stored, "M1") is None:
        raise fail(file, None, "neither camera_matrix nor M1 is in the file; give a calibration that OpenCV wrote")
    first, second = (_inner(stored, f"M{i}", f"D{i}", file, False) for i in (1, 2))
    rotation, translation = _stereo_pose(stored if extrinsics is None else _stored(extrinsics, file), file)
    if metres is None:
        raise fail(
            file, None, "the unit of T is not in the file; state the unit of length, that of the squares of the board"
        )
    cameras = (
        Camera("left", size, *first, np.eye(3), np.zeros(3)),
        Camera("right", size, *second, rotation, translation * metres),
    )
    return check_cameras(file, CameraSet(cameras, None, ("space has the axes of the first camera",)))


def lens_of(coefficients: Array, where: str, fisheye: bool) -> Lens:
    """Return the lens with OpenCV's ``coefficients``; DatasetError if it is tilted or has thin prism terms."""
    values = np.ravel(coefficients)
    if fisheye:
        if len(values) != len(COEFFICIENTS["fisheye"]):
            raise fail(where, len(values), f"{len(values)} coefficients of a fisheye lens; it has 4: k1 to k4")
        return Lens("fisheye", tuple(values.tolist()))
    if len(values) not in MODELS:
        known = ", ".join(map(str, MODELS))
        raise fail(where, len(values), f"{len(values)} coefficients; OpenCV writes {known}: calibrate again")
    model = MODELS[len(values)]
    count = len(COEFFICIENTS[model])
    if np.any(values[count:] != 0):
        message = "thin prism or tilted sensor coefficients are not zero; calibrate without these"
        raise fail(where, float(np.abs(values[count:]).max()), message)
    return Lens(model, tuple(np.pad(values[:count], (0, max(count - len(values), 0))).tolist()))


def checked_matrix(matrix: Array, where: str) -> Array:
    """Return the ``matrix`` [3, 3] of a camera; DatasetError if it is none, or has skew."""
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all() or np.abs(matrix[[1, 2, 2], [0, 0, 1]]).max() > 0:
        raise fail(where, None, "this is no matrix of a camera [[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]]")
    if matrix[2, 2] != 1 or abs(matrix[0, 1]) > MOST_SKEW * abs(matrix[0, 0]):
        raise fail(
            where, matrix[0, 1], f"skew {matrix[0, 1]:g}, scale {matrix[2, 2]:g}; a camera has 0 and 1: calibrate again"
        )
    return matrix


def _stored(raw: bytes, file: str) -> Any:
    cv2 = opencv()
    check_most(file, "is", len(raw) / MIB, MOST_BYTES / MIB, "MiB", "give the file of a calibration")
    if _nested(raw) > MOST_NESTED:
        message = f"nested deeper than {MOST_NESTED} levels; give the file of a calibration that OpenCV wrote"
        raise fail(file, None, message)
    try:
        stored = cv2.FileStorage(raw.decode("utf-8"), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, UnicodeDecodeError, SystemError) as error:
        message = f"OpenCV cannot read this file ({' '.join(str(error).split())[:120]}); write it again"
        raise fail(file, None, message) from None
    if not stored.isOpened():
        raise fail(file, None, "OpenCV cannot read this file; write it again")
    return stored


def _nested(raw: bytes) -> int:
    """Return how deep the contents of a file are nested: OpenCV reads them recursively, and ends the process."""
    level = deepest = 0
    for part in _NESTING.finditer(raw):
        closes = part[0] in (b"]", b"}", b"</")
        level = max(level - 1, 0) if closes else level + 1
        deepest = max(deepest, level)
    return max(deepest, *((len(line) - len(line.lstrip(b" "))) // 2 for line in raw.splitlines() or [b""]), 0)


def _matrix(stored: Any, name: str) -> Array | None:
    node = stored.getNode(name)
    if node.empty() or not node.isMap():
        return None
    try:
        found = node.mat()
    except opencv().error:
        message = f"{name} is no matrix: its rows, cols, dt and data do not belong together; write the file again"
        raise fail(name, None, message) from None
    return None if found is None or np.ndim(found) != 2 else np.asarray(found, dtype=float)


def _needed(stored: Any, name: str, file: str) -> Array:
    found = _matrix(stored, name)
    if found is None:
        raise fail(f"{file}: {name}", None, f"the matrix {name!r} is missing; give a complete calibration")
    return found


def _inner(stored: Any, matrix: str, coefficients: str, file: str, fisheye: bool) -> tuple[Array, Lens]:
    where = f"{file}: {matrix}"
    lens = lens_of(_needed(stored, coefficients, file), f"{file}: {coefficients}", fisheye)
    return checked_matrix(_needed(stored, matrix, file), where), lens


def _stereo_pose(stored: Any, file: str) -> tuple[Array, Array]:
    if _matrix(stored, "R") is None:
        raise fail(f"{file}: R", None, "R and T of the pair are in another file; give extrinsics.yml too")
    rotation, translation = _needed(stored, "R", file), np.ravel(_needed(stored, "T", file))
    if rotation.shape != (3, 3) or len(translation) != 3 or abs(np.linalg.det(rotation) - 1) > ROUNDING:
        raise fail(f"{file}: R", None, "R is no rotation matrix or T no vector of 3; calibrate again")
    return rotation, translation


def _pixels(nodes: Sequence[Any], file: str) -> tuple[int, int]:
    width, height = (node.real() if node.isReal() or node.isInt() else float("nan") for node in nodes)
    if not (1 <= width <= LARGEST_PX and 1 <= height <= LARGEST_PX and width % 1 == height % 1 == 0):
        message = f"image_width or image_height is no whole number from 1 to {LARGEST_PX}; write the file again"
        raise fail(file, f"{width:g} x {height:g}", message)
    return int(width), int(height)


def _size(stored: Any, file: str, stated: tuple[int, int] | None) -> tuple[int, int]:
    nodes = [stored.getNode(name) for name in ("image_width", "image_height")]
    read = None if any(node.empty() for node in nodes) else _pixels(nodes, file)
    if read is None and stated is None:
        raise fail(file, None, "the size of the images is not in the file; state width and height (px)")
    if read is not None and stated is not None and read != stated:
        message = (
            f"images of {read[0]} x {read[1]} px in the file, but {stated[0]} x {stated[1]} px are stated; omit it"
        )
        raise fail(file, f"{stated[0]} x {stated[1]}", message)
    return read or stated or (0, 0)
