"""Frames late in a video are reached by its index, and are those that counting from the start gives."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from wingfit.cameras.video import source
from wingfit.cameras.video.frame_index import FrameIndex, read_index
from wingfit.cameras.video.source import Film, Frames
from wingfit.records.array_types import Array

SIZE, FRAMES, BITS = (64, 48), 5000, 13
CODECS = {"mjpg.avi": "MJPG", "xvid.avi": "XVID", "mp4v.mp4": "mp4v", "ffv1.mkv": "FFV1"}


def numbered(number: int) -> Array:
    """A frame that shows its number: a white or black square for each bit."""
    image = np.zeros(SIZE[::-1], np.uint8)
    for bit in range(BITS):
        row, column = divmod(bit, 8)
        image[24 * row : 24 * row + 24, 8 * column : 8 * column + 8] = 255 * (number >> bit & 1)
    return image


def shown(image: Array | None) -> int:
    assert image is not None
    return sum(int(image[24 * (bit // 8) + 12, 8 * (bit % 8) + 4] > 127) << bit for bit in range(BITS))


def write(path: Path, codec: str, count: int = FRAMES) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), 30.0, SIZE, isColor=False)
    for number in range(count):
        writer.write(numbered(number))
    writer.release()
    return path


@pytest.fixture(scope="module", params=sorted(CODECS))
def video(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("long") / request.param, CODECS[request.param])


def packets(path: Path) -> list[bytes]:
    """The packets of the container, which are not decoded."""
    video = cv2.VideoCapture(str(path))
    video.set(cv2.CAP_PROP_FORMAT, -1)
    found = list[bytes]()
    while True:
        there, packet = video.read()
        if not there:
            return found
        found.append(np.asarray(packet).tobytes())


class Counted:
    """A video whose decoded frames are counted."""

    decoded = 0

    def __init__(self, *words: Any) -> None:
        self.video = cv2.VideoCapture(*words)
        self.raw = False

    def grab(self) -> bool:
        Counted.decoded += not self.raw
        return bool(self.video.grab())

    def set(self, name: int, value: float) -> bool:
        self.raw = self.raw or name == cv2.CAP_PROP_FORMAT
        return bool(self.video.set(name, value))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.video, name)


def counted(frames: Frames, monkeypatch: pytest.MonkeyPatch) -> None:
    Counted.decoded = 0
    monkeypatch.setattr(frames, "_open", lambda: Counted(str(frames.path)))


def test_a_late_frame_is_reached_without_those_before(video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = Film(video).opened()
    counted(frames, monkeypatch)
    for number in (4999, 4321, 100, 2500, 2499, 777, 99, 0):
        found = list(islice(frames.read(number), 3))
        expected = list(range(number, min(number + 3, FRAMES)))
        assert [at for at, _ in found] == expected
        assert [shown(image) for _, image in found] == expected
    assert Counted.decoded < 1500  # the first hundred are decoded each time


def test_frames_from_a_late_one_to_the_end_are_all_read(video: Path) -> None:
    frames = Film(video).opened()
    assert [at for at, _ in frames.read(4900)] == list(range(4900, FRAMES))
    assert frames.ended == FRAMES
    frames.ended = None
    assert list(frames.read(FRAMES + 10)) == []
    assert frames.ended == FRAMES


def test_the_same_frame_is_decoded_to_the_same_pixels(video: Path) -> None:
    frames = Film(video).opened()
    whole = {number: image for number, image in frames.read() if number in (1000, 3003)}
    for number, image in whole.items():
        _, again = next(frames.read(number))
        assert again is not None
        assert image is not None
        assert np.array_equal(again, image)


@pytest.mark.parametrize("content", ["zeros", "random"])
def test_a_damaged_packet_costs_one_frame(content: str, tmp_path: Path) -> None:
    """The frames behind it keep their numbers, whether they are counted or sought."""
    path = write(tmp_path / "whole.avi", "MJPG", 300)
    raw, packet = bytearray(path.read_bytes()), packets(path)[150]
    assert raw.count(packet) == 1
    at = raw.find(packet)
    damage = bytes(len(packet)) if content == "zeros" else np.random.default_rng(1).bytes(len(packet))
    raw[at : at + len(packet)] = damage
    path.write_bytes(bytes(raw))
    expected = [None if number == 150 else number for number in range(300)]
    for first in (0, 140, 150, 151, 200):
        frames = Film(path).opened()
        found = [(number, None if image is None else shown(image)) for number, image in frames.read(first)]
        assert found == list(zip(range(first, 300), expected[first:], strict=True))
        assert frames.ended == 300


def test_a_damaged_packet_without_index_ends_the_film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "whole.avi", "MJPG", 300)
    raw, packet = path.read_bytes(), packets(path)[150]
    path.write_bytes(raw.replace(packet, bytes(len(packet))))
    monkeypatch.setattr(source, "read_index", lambda *_: None)
    frames = Film(path).opened()
    assert [shown(image) for _, image in frames.read()] == list(range(150))
    assert frames.ended == 150


@pytest.mark.parametrize("wrong", ["shifted", "missing", "none"])
def test_an_index_that_is_wrong_is_not_used(video: Path, wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Counting from the start then finds the frame."""
    frames = Film(video).opened()
    whole = read_index(lambda: cv2.VideoCapture(str(video)), FRAMES)
    assert whole is not None
    assert whole.number(float(whole.times[3])) == 3
    assert whole.number(float(whole.times[3]) + 1.0) is None
    times = {"shifted": whole.times + 3.0, "missing": np.delete(whole.times, slice(1190, 1200, 2)), "none": None}[wrong]
    monkeypatch.setattr(source, "read_index", lambda *_: None if times is None else FrameIndex(times))
    number, image = next(frames.read(1199))
    assert (number, shown(image)) == (1199, 1199)


class _Irregular:
    """A video of ten frames, of which packets have the ``times`` and frames begin at ``start``."""

    def __init__(self, times: list[float], start: int) -> None:
        self.times, self.at, self.start = times, -1, start

    def set(self, name: int, _: float) -> bool:
        assert name == cv2.CAP_PROP_FORMAT
        self.start = 0
        return True

    def grab(self) -> bool:
        self.at += 1
        return self.at + self.start < len(self.times)

    def get(self, _: int) -> float:
        return self.times[self.at + self.start]

    def release(self) -> None:
        pass


@pytest.mark.parametrize(
    ("times", "start", "count", "known"),
    [
        ([0.0, 40.0, 20.0, 60.0], 0, 4, False),  # frames in this order would not be shown in order
        ([0.0, 20.0, 40.0, 61.0, 90.0], 0, 5, True),  # the rate varies
        ([0.0, 20.0, 20.0, 60.0], 0, 4, False),
        ([0.0, 20.0, 40.0, 60.0], 1, 4, False),  # the first packet gives no frame
        ([0.0, 20.0, 40.0, 60.0], 0, 40, False),
        ([0.0, 20.0, 40.0, 60.0], 0, 0, True),
    ],
)
def test_packets_that_are_no_frames_give_no_index(times: list[float], start: int, count: int, known: bool) -> None:
    found = read_index(lambda: _Irregular(times, start), count)
    assert (found is not None) == known


def test_images_have_late_frames_too(tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), numbered(number))
    reading: Iterator[tuple[int, Array | None]] = Film(tmp_path, 10.0).opened().read(2)
    assert [(number, shown(image)) for number, image in reading] == [(2, 2)]
