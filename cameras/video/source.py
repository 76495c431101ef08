"""The frames of one camera, from a video file or a folder of images, one at a time."""

from __future__ import annotations

import filecmp
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from wingfit.cameras.opencv import opencv
from wingfit.cameras.video.frame_index import FrameIndex, read_index
from wingfit.records.array_types import Array
from wingfit.records.errors import fail

IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm")
VIDEOS = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mts", ".wmv")
MOST_PIXELS = 64_000_000
NEAR = 100
"""Frames that are decoded and passed over, rather than sought."""
_FASTEST_HZ = 1_000_000.0
_GAP = 1.5  # frames between the times of two that were decoded one after the other: one between them is damaged


@dataclass(frozen=True)
class Film:
    """Frames of one camera.

    Attributes:
        path: of a video file, or of a folder with one image per frame, in the order of the numbers in their names.
        rate_hz: frames per second; that of the file if None. Images have none, and videos of a high-speed camera state
            that of playback.
    """

    path: Path
    rate_hz: float | None = None

    def opened(self) -> Frames:
        """Return the frames; DatasetError if the path holds none or the rate is unknown."""
        if self.rate_hz is not None and not 0 < self.rate_hz < _FASTEST_HZ:
            raise fail(
                str(self.path), self.rate_hz, f"rate_hz is {self.rate_hz}; it must be above 0, in frames per second"
            )
        if self.path.is_dir():
            return _ImageFrames(self.path, self.rate_hz)
        if not self.path.exists():
            raise fail(
                str(self.path), None, "is no file or folder; state the path of a video, or of a folder of images"
            )
        return _VideoFrames(self.path, self.rate_hz)


def same_film(one: Path, other: Path) -> bool:
    """Return whether two videos or folders of images are one, or copies of one."""
    pairs = [(one, other)]
    if one.resolve() == other.resolve():
        return True
    if one.is_dir() and other.is_dir():
        first, second = images_in(one), images_in(other)
        if len(first) != len(second):
            return False
        pairs = list(zip(first, second, strict=True))
    elif one.is_dir() or other.is_dir():
        return False
    try:
        return bool(pairs) and all(filecmp.cmp(*pair, shallow=False) for pair in pairs)
    except OSError:  # what reads the films says so
        return False


class Frames:
    """Grey frames [H, W] of a film.

    Attributes:
        path: of the film.
        size_px: width and height.
        rate_hz: frames per second.
        count: of frames; what the container of a video states, 0 if it does not.
        ended: number of frames before the end, once the film was read to its end; less than ``count`` if a video is
            damaged or cut off.
    """

    path: Path
    size_px: tuple[int, int]
    rate_hz: float
    count: int
    ended: int | None = None

    def read(self, first: int = 0) -> Iterator[tuple[int, Array | None]]:
        """Return frames with their numbers, from number ``first``; None is a frame that cannot be decoded.

        A late frame is sought by the index of the container, if that is sure to be the same as counting.
        """
        raise NotImplementedError

    def _check(self) -> None:
        width, height = self.size_px
        if width * height > MOST_PIXELS:
            raise fail(
                str(self.path), width * height, f"frames have {width} x {height} pixels; at most {MOST_PIXELS} are read"
            )


class _ImageFrames(Frames):
    def __init__(self, folder: Path, rate_hz: float | None) -> None:
        self.path = folder
        self.files = images_in(folder)
        if not self.files:
            raise fail(str(folder), None, f"holds no images; a frame is a file ending in {', '.join(IMAGES)}")
        if rate_hz is None:
            raise fail(str(folder), None, "images have no frame rate; state rate_hz, in frames per second")
        first = _image(self.files[0])
        if first is None:
            raise fail(str(self.files[0]), None, "cannot be read as an image; save it as PNG")
        self.size_px = (first.shape[1], first.shape[0])
        self.rate_hz, self.count = rate_hz, len(self.files)
        self._check()

    def read(self, first: int = 0) -> Iterator[tuple[int, Array | None]]:
        for number, file in enumerate(self.files[first:], first):
            image = _image(file)
            fits = image is not None and image.shape == self.size_px[::-1]
            yield number, image if fits else None


class _VideoFrames(Frames):
    def __init__(self, file: Path, rate_hz: float | None) -> None:
        self.path = file
        cv2 = opencv()
        video = self._open()
        self.size_px = (int(video.get(cv2.CAP_PROP_FRAME_WIDTH)), int(video.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        stated = float(video.get(cv2.CAP_PROP_FPS))
        self.count = max(int(video.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
        self._check()
        readable, _ = video.read()
        video.release()
        if not readable:
            raise fail(str(file), None, "holds no frame that can be decoded; convert it, for example to MP4 with H.264")
        self._stated_hz = stated
        self.rate_hz = rate_hz if rate_hz is not None else stated
        if not 0 < self.rate_hz < _FASTEST_HZ:
            raise fail(str(file), stated, "states no frame rate; state rate_hz, in frames per second")

    def _open(self) -> Any:
        try:
            # OpenCV ends the process if it is given bytes that are no text.
            named = str(self.path).encode().decode()
        except UnicodeEncodeError:
            message = "its name is not in UTF-8, which OpenCV does not open; rename the file"
            raise fail(ascii(str(self.path)), None, message) from None
        video = opencv().VideoCapture(named)
        if not video.isOpened():
            endings = ", ".join(VIDEOS)
            raise fail(
                str(self.path), None, f"cannot be read as a video; use a common container ({endings}), or images"
            )
        return video

    def read(self, first: int = 0) -> Iterator[tuple[int, Array | None]]:
        video, number = self._at(first)
        try:
            while (at := self._grabbed(video, number)) is not None:
                yield from ((lost, None) for lost in range(max(number, first), at))
                if at >= first:
                    readable, image = video.retrieve()
                    yield at, _grey(image) if readable else None
                number = at + 1
            self.ended = number
        finally:
            video.release()

    def _grabbed(self, video: Any, number: int) -> int | None:
        """Decode the next frame of ``video``, ``number`` if none is damaged; return its number, None at the end.

        A damaged packet ends what OpenCV decodes, or is passed over; the index then shows which frame is next.
        """
        cv2 = opencv()
        step = 1e3 / self._stated_hz if self._stated_hz > 0 else np.inf
        before = video.get(cv2.CAP_PROP_POS_MSEC)
        if video.grab():
            if video.get(cv2.CAP_PROP_POS_MSEC) - before < _GAP * step or number == 0 or self._index is None:
                return number
        elif self._index is None or not any(video.grab() for _ in range(number + 1, len(self._index.times))):
            return None
        index = self._index
        found = None if index is None else index.number(video.get(cv2.CAP_PROP_POS_MSEC))
        return number if found is None else max(found, number)

    @cached_property
    def _index(self) -> FrameIndex | None:
        """Return where the frames are; None if that is not sure."""
        return read_index(self._open, self.count)

    def _at(self, first: int) -> tuple[Any, int]:
        """Return the video and the number of the frame that it decodes next: ``first``, or one before it."""
        if first >= NEAR and self._index is not None:
            video, number = self._open(), min(first, len(self._index.times) - 1)
            if self._index.seek(video, number):
                return video, number
            video.release()
        # Earlier frames are decoded and passed over.
        return self._open(), 0


def images_in(folder: Path) -> list[Path]:
    """Return the images in ``folder``, in the order of the numbers in their names."""
    # Names that start with a dot are hidden files, which macOS writes beside images on other systems' disks.
    images = (one for one in folder.iterdir() if one.suffix.lower() in IMAGES and not one.name.startswith("."))
    return sorted(images, key=_by_number)


def _image(file: Path) -> Array | None:
    """Return the grey image in ``file``; None if it cannot be read."""
    cv2 = opencv()
    try:
        # Not cv2.imread, which ends the process if the name is not in UTF-8.
        data = np.frombuffer(file.read_bytes(), np.uint8)
        return _grey(cv2.imdecode(data, cv2.IMREAD_UNCHANGED)) if len(data) else None
    except (OSError, cv2.error):
        return None


def _grey(image: Array | None) -> Array | None:
    """Return an image without colour."""
    if image is None:
        return None
    if image.ndim == 3:
        cv2 = opencv()
        code = cv2.COLOR_BGRA2GRAY if image.shape[2] == 4 else cv2.COLOR_BGR2GRAY
        return np.asarray(cv2.cvtColor(image, code))
    return image


def _by_number(file: Path) -> tuple[list[tuple[int, str]], str]:
    """Return a key by which frame9 is before frame10."""
    parts = re.findall(r"\d+|\D+", file.stem)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], file.name
