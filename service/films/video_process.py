"""Process that reads one video for the server: ``python -m wingfit.service.films.video_process PATH RATE_HZ``.

Each line of standard input is a request as JSON: ``{"do": "facts"}``, or ``{"do": "jpeg", "number", "width_px"}`` or
``{"do": "markers", "number", "kind"}`` of one frame. Each answer is two lengths (8 bytes), JSON of the first length and
bytes of the second. The process keeps its place in the video, so that the next frame is read at once; it ends when its
input ends, or nothing was wanted for ``IDLE_SECONDS``.
"""

from __future__ import annotations

import json
import os
import resource
import select
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wingfit.cameras.opencv import opencv
from wingfit.cameras.track.film_detections import detect_frame
from wingfit.cameras.video.source import NEAR, Film, Frames
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError, fail
from wingfit.records.limits import MIB
from wingfit.service.films.child import LENGTHS, NICENESS, listed

IDLE_SECONDS = 120.0
MEMORY_MIB = 4096  # of address space beside that of the libraries
QUALITY = 85  # of JPEG, percent

Answer = tuple[dict[str, Any], bytes]


class _Video:
    """The frames of one video, read forwards; a frame that is far away is sought."""

    def __init__(self, path: Path, rate_hz: float | None) -> None:
        self.frames: Frames = Film(path, rate_hz).opened()
        self._read_from(0)

    def _read_from(self, number: int) -> None:
        self._reading: Iterator[tuple[int, Array | None]] = self.frames.read(number)
        self._last: tuple[int, Array | None] = (-1, None)

    def frame(self, number: int) -> Array:
        """Return frame ``number``; DatasetError if it cannot be decoded, IndexError if the video is shorter."""
        if not self._last[0] <= number <= self._last[0] + NEAR:
            self._read_from(number)
        while self._last[0] < number:
            found = next(self._reading, None)
            if found is None:
                self._read_from(0)
                raise IndexError(self.frames.ended)
            self._last = found
        image = self._last[1]
        if image is None:
            raise fail(f"frame {number}", number, "cannot be decoded; look at another frame")
        return image


def _answer(video: _Video, request: dict[str, Any]) -> Answer:
    frames = video.frames
    if request["do"] == "facts":
        width, height = frames.size_px
        return {"frames": frames.count, "width_px": width, "height_px": height, "rate_hz": frames.rate_hz}, b""
    image = video.frame(request["number"])
    if request["do"] == "markers":
        pixels = detect_frame(image, request["kind"]).pixels
        return {"markers": [{"x_px": round(x, 3), "y_px": round(y, 3)} for x, y in pixels.tolist()]}, b""
    return {}, _jpeg(image, request["width_px"])


def _jpeg(image: Array, width: int | None) -> bytes:
    """Return ``image`` as JPEG, scaled down to at most ``width`` pixels."""
    cv2 = opencv()
    if width is not None and width < image.shape[1]:
        height = max(1, round(image.shape[0] * width / image.shape[1]))
        image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    _, encoded = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, QUALITY))
    return bytes(encoded)


def _confine() -> None:
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    if sys.platform == "linux":  # elsewhere the limit does not exist, or the present size is unknown
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + MEMORY_MIB * MIB
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _respond(video: _Video | None, request: dict[str, Any], path: Path, rate_hz: float | None) -> tuple[_Video, Answer]:
    video = video or _Video(path, rate_hz)
    return video, _answer(video, request)


def main(arguments: list[str]) -> None:
    """Answer requests until the input ends."""
    path, rate_hz = Path(arguments[0]), float(arguments[1]) or None
    opencv()
    _confine()
    video: _Video | None = None
    while select.select([sys.stdin], [], [], IDLE_SECONDS)[0]:
        line = sys.stdin.buffer.readline()
        if not line:
            return
        try:
            video, (answer, body) = _respond(video, json.loads(line), path, rate_hz)
        except DatasetError as error:
            answer, body = {"faults": listed(error)}, b""
        except IndexError as error:
            answer, body = {"count": error.args[0]}, b""
        except MemoryError:
            message = f"takes more than {MEMORY_MIB} MiB; film smaller images"
            answer, body = {"faults": [[path.name, None, message]]}, b""
        head = json.dumps(answer).encode()
        sys.stdout.buffer.write(LENGTHS.pack(len(head), len(body)) + head + body)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
