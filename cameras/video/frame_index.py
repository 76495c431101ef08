"""Where in a video a frame is: times of all frames, from the packets of the container, which are not decoded.

What a container calls frame 5000 is a time, and often not the 5000th frame that is decoded: frames are dropped or
doubled, and the rate may vary. Here frames are counted, and a place that was sought is known by its time. So are the
frames behind a damaged packet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from wingfit.cameras.opencv import opencv
from wingfit.records.array_types import Array, Float

_COMPARED = 8  # frames at the start whose times must be those of the index
_COUNT_OFF = 3  # frames by which the count of a container may be wrong
_BEFORE = (8, 64, 512)  # frames before the one that is sought at which decoding begins, until one is early enough


@dataclass(frozen=True, eq=False)
class FrameIndex:
    """Times (ms) of the frames of a video in the order in which they are shown, N of them."""

    times: Float[Array, " N"]

    def number(self, time: float) -> int | None:
        """Return the number of the frame with exactly this ``time`` (ms); None if there is none."""
        at = int(np.searchsorted(self.times, time))
        return at if at < len(self.times) and self.times[at] == time else None

    def seek(self, video: Any, number: int) -> bool:
        """Make frame ``number`` the next one that ``video`` decodes; False if it is not sure that it is.

        Some frames before it are decoded, and each must have its own time.
        """
        cv2 = opencv()
        for before in _BEFORE:
            begin = max(number - before, 0)
            if not video.set(cv2.CAP_PROP_POS_MSEC, float(self.times[begin])) or not video.grab():
                return False
            at = self.number(video.get(cv2.CAP_PROP_POS_MSEC))
            if at is None:
                return False
            if at < number:
                return all(
                    video.grab() and self.number(video.get(cv2.CAP_PROP_POS_MSEC)) == expected
                    for expected in range(at + 1, number)
                )
        return False


def read_index(opened: Callable[[], Any], count: int) -> FrameIndex | None:
    """Return the index of a video, of which the container states ``count`` frames (0: it does not).

    None if packets and frames do not belong together: then only counting from the start says which frame is which.
    """
    cv2 = opencv()
    packets, video = opened(), opened()
    try:
        if not packets.set(cv2.CAP_PROP_FORMAT, -1):
            return None
        times: Array = np.fromiter(_times(packets), dtype=float)
        if len(np.unique(times)) < len(times) or (count and abs(len(times) - count) > _COUNT_OFF):
            return None
        index = FrameIndex(np.sort(times))
        first = [index.number(time) for time, _ in zip(_times(video), range(_COMPARED), strict=False)]
        return index if first == list(range(min(_COMPARED, len(times)))) else None
    finally:
        packets.release()
        video.release()


def _times(video: Any) -> Iterator[float]:
    """Yield the time (ms) of each packet or frame."""
    cv2 = opencv()
    while video.grab():
        yield float(video.get(cv2.CAP_PROP_POS_MSEC))
