"""Cameras before their poses are calibrated with a wand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.files.camera_set import LARGEST_PX, MOST_FOCAL_PX
from wingfit.cameras.files.read import read_cameras
from wingfit.records.errors import fail, nearest

_NARROWEST, _WIDEST = 0.3, 100.0  # focal lengths in widths of the image


def known_cameras(path: Path, names: Sequence[str]) -> list[Camera]:
    """Return the cameras with these ``names`` in the file ``path``; DatasetError if one is missing."""
    found = {camera.name: camera for camera in read_cameras(path).cameras}
    for name in names:
        if name not in found:
            message = f"has no camera {name!r}, which the points of the wand have; {nearest(name, found)}"
            raise fail(path.name, name, message)
    return [found[name] for name in names]


def rough_cameras(names: Sequence[str], sizes_px: Sequence[tuple[int, int]], focal_px: Sequence[float]) -> list[Camera]:
    """Return cameras without distortion, with the principal point in the middle of the image and no pose.

    ``sizes_px`` and ``focal_px`` are one for all cameras, or one for each.
    """
    for what, given in (("sizes of images", sizes_px), ("focal lengths", focal_px)):
        if len(given) not in (1, len(names)):
            raise fail("wand", len(given), f"{len(given)} {what} for {len(names)} cameras; give one, or one for each")
    cameras = []
    for number, name in enumerate(names):
        width, height = sizes_px[number % len(sizes_px)]
        focal = focal_px[number % len(focal_px)]
        if not (1 < width <= LARGEST_PX and 1 < height <= LARGEST_PX):
            size = f"{width}x{height}"
            raise fail("wand, size", size, f"{size} px; sides must be from 2 to {LARGEST_PX} px")
        if not _NARROWEST * width <= focal <= min(_WIDEST * width, MOST_FOCAL_PX):
            least, most = _NARROWEST * width, _WIDEST * width
            message = f"{focal:g} px; it must be {least:g} to {most:g} px: its length in mm over that of a pixel"
            raise fail("wand, focal length", f"{focal:g}", message)
        matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
        cameras.append(Camera(name, (width, height), matrix, Lens("brown", (0.0,) * 5), np.eye(3), np.zeros(3)))
    return cameras
