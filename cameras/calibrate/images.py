"""Which images of several cameras were taken at the same time, and how they are read."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from wingfit.cameras.opencv import opencv
from wingfit.records.array_types import Array
from wingfit.records.errors import fail

Match = Literal["stem", "index", "position"]
_NUMBER = re.compile(r"(\d+)\D*$")


def views_of_images(images: Mapping[str, Sequence[Path]], match: Match | None = None) -> dict[str, dict[str, Path]]:
    """Return for each view the image of each camera that has one, by name of the view, then of the camera.

    Images belong together that have the same stem, or else the same last number in their stem, or else the same
    position in the lists of their cameras. ``match`` states which; if None, the first that suits all cameras is used.
    """
    for rule in (match,) if match else ("stem", "index", "position"):
        keys = {camera: [_key(rule, path, i) for i, path in enumerate(paths)] for camera, paths in images.items()}
        if _suits(rule, keys):
            views: dict[str, dict[str, Path]] = {}
            for camera, paths in images.items():
                for key, path in zip(keys[camera], paths, strict=True):
                    views.setdefault(str(key), {})[camera] = path
            return dict(sorted(views.items(), key=lambda one: _natural(one[0])))
    counts = ", ".join(f"{camera}: {len(paths)}" for camera, paths in images.items())
    raise fail(
        "calibration, images",
        match,
        f"which images belong together is not clear ({counts}); give files that were taken at the same time the same "
        "name or the same last number, or give each camera the same number of images in the same order",
    )


def _key(rule: Match, path: Path, position: int) -> str | int | None:
    if rule == "stem":
        return path.stem
    if rule == "index":
        found = _NUMBER.search(path.stem)
        return int(found[1]) if found else None
    return position


def _suits(rule: Match, keys: Mapping[str, Sequence[str | int | None]]) -> bool:
    """Return whether every image has a key of its own in its camera, and every camera shares one with another."""
    if rule == "position":
        return len({len(own) for own in keys.values()}) == 1
    if any(None in own or len(set(own)) < len(own) for own in keys.values()):
        return False
    sets = {camera: set(own) for camera, own in keys.items()}
    if len(sets) == 1:
        return True
    return all(any(own & other for name, other in sets.items() if name != camera) for camera, own in sets.items())


def _natural(text: str) -> list[tuple[int, int | str]]:
    return [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", text) if part]


def read_grey(path: Path) -> Array:
    """Return the image in ``path`` as unsigned bytes [height, width], stretched to its darkest and brightest values."""
    cv2 = opencv()
    if not path.is_file():
        raise fail(str(path), None, "there is no such file; check the path")
    data = np.frombuffer(path.read_bytes(), np.uint8)
    try:
        image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH) if len(data) else None
    except cv2.error:
        image = None
    if image is None:
        raise fail(str(path), None, "this is no image that OpenCV reads; convert it to PNG or TIFF")
    values = np.asarray(image, dtype=float)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if not high > low:
        return np.zeros(values.shape, np.uint8)
    return np.asarray(np.round((values - low) * (255 / (high - low))), dtype=np.uint8)
