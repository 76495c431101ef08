"""Length of a waved wand, triangulated with cameras that its film had no part in calibrating."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.markers.dot import detect_dots
from wingfit.cameras.track.cloud import possible_points
from wingfit.cameras.video.source import Film
from wingfit.records.array_types import Array

TOLERANCE_PX = 0.3
EVERY = 5  # frames


def wand_error_percent(folder: Path, cameras: tuple[Camera, ...]) -> float:
    """Return the RMS error of the length of the wand in percent, over frames in which two cameras see both balls."""
    true = json.loads((folder / "scene.json").read_text())["wand_m"]
    films = [Film(folder / f"wand-{camera.name}.avi").opened() for camera in cameras]
    lengths = []
    for together in zip(*(film.read() for film in films), strict=False):
        number = together[0][0]
        images = [image for _, image in together]
        if number % EVERY or any(image is None for image in images):
            continue
        length = _length(cameras, [image for image in images if image is not None])
        if length is not None:
            lengths.append(length)
    return float(100 * np.sqrt(np.mean((np.array(lengths) / true - 1) ** 2)))


def _length(cameras: tuple[Camera, ...], images: list[Array]) -> float | None:
    """Return the distance (m) of the two points whose rays meet best; None if fewer are seen."""
    seen = [detect_dots(image, float(np.median(image)), 2.0) for image in images]
    cloud = possible_points(cameras, seen, TOLERANCE_PX, (0.1, 10.0))
    best, least = None, np.inf
    for one in range(len(cloud)):
        for two in range(one):
            apart = cloud.detections[:, one] != cloud.detections[:, two]
            cost = cloud.points.misfit[one] + cloud.points.misfit[two]
            if apart.all() and cost < least:
                best, least = float(np.linalg.norm(cloud.positions[one] - cloud.positions[two])), float(cost)
    return best
