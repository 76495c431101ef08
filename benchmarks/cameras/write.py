"""Writes images and videos with OpenCV."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
CODECS = {".avi": "MJPG", ".mp4": "mp4v", ".mkv": "FFV1"}
JPEG_QUALITY = 95


def write_image(path: Path, image: Image) -> None:
    """Write a grey image [height, width] as PNG or JPEG, by the suffix of ``path``; OSError if that is impossible."""
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if path.suffix in {".jpg", ".jpeg"} else []
    if not cv2.imwrite(str(path), image, options):
        raise OSError(f"{path}: the image cannot be written; is the folder writable?")


def write_video(path: Path, images: Iterable[Image], size: tuple[int, int], rate: float) -> int:
    """Write grey images of (width, height) ``size`` at ``rate`` frames per second; returns their number.

    The suffix of ``path`` is .avi (each frame a JPEG), .mp4 (MPEG-4 part 2, which also uses neighbouring frames) or
    .mkv (FFV1, without loss). OpenCV offers no choice of quality with FFmpeg: the first two remove most of the noise in
    the dark, and change bright pixels by about two grey levels.
    """
    if path.suffix not in CODECS:
        raise ValueError(f"{path}: videos have the suffixes {', '.join(CODECS)}")
    codec = cv2.VideoWriter.fourcc(*CODECS[path.suffix])
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, codec, rate, size, isColor=False)
    if not writer.isOpened():
        raise OSError(f"{path}: OpenCV cannot write this video; is the folder writable?")
    count = 0
    try:
        for image in images:
            writer.write(image)
            count += 1
    finally:
        writer.release()
    return count
