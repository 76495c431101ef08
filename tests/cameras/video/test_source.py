"""Frames of videos and of folders of images."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from wingfit.cameras.video.source import Film
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError

SIZE = (64, 48)


def level(number: int) -> Array:
    """A frame of one level of grey, which says its number."""
    return np.full(SIZE[::-1], 10 * number + 20, np.uint8)


def write_images(folder: Path, numbers: list[int], name: str = "frame{}.png") -> Path:
    folder.mkdir()
    for number in numbers:
        cv2.imwrite(str(folder / name.format(number)), level(number))
    return folder


def levels(film: Film, first: int = 0) -> list[tuple[int, float | None]]:
    return [(number, None if frame is None else float(frame.mean())) for number, frame in film.opened().read(first)]


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    for number in range(12):
        writer.write(cv2.cvtColor(level(number), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def test_images_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    folder = write_images(tmp_path / "images", [10, 9, 2, 1, 11])
    (folder / "._frame1.png").write_bytes(b"not an image")
    (folder / "notes.txt").write_text("not a frame")
    frames = Film(folder, 100.0).opened()
    assert (frames.size_px, frames.rate_hz, frames.count) == (SIZE, 100.0, 5)
    expected = [(0, 30.0), (1, 40.0), (2, 110.0), (3, 120.0), (4, 130.0)]
    assert levels(Film(folder, 100.0)) == expected
    assert levels(Film(folder, 100.0), 3) == expected[3:]


@pytest.mark.parametrize("name", ["{:03d}.png", "a1_{}.png", "cam2-frame{}-x.png", "{}².png"])
def test_numbers_are_found_in_names(tmp_path: Path, name: str) -> None:
    folder = write_images(tmp_path / "images", [3, 12, 20], name)
    assert [shown for _, shown in levels(Film(folder, 1.0))] == [50.0, 140.0, 220.0]


def test_a_frame_that_cannot_be_used_is_none(tmp_path: Path) -> None:
    folder = write_images(tmp_path / "images", [1, 2, 3, 4])
    (folder / "frame2.png").write_bytes(b"\x89PNG torn")
    cv2.imwrite(str(folder / "frame3.png"), np.zeros((48, 65), np.uint8))
    assert levels(Film(folder, 100.0)) == [(0, 30.0), (1, None), (2, None), (3, 60.0)]


def test_a_name_that_is_no_text_is_read_or_refused(tmp_path: Path, video: Path) -> None:
    """OpenCV itself ends the process at such a name."""
    folder = write_images(tmp_path / "images", [1, 2])
    (folder / "frame2.png").rename(folder / os.fsdecode(b"frame2\xff.png"))
    assert levels(Film(folder, 100.0)) == [(0, 30.0), (1, 40.0)]
    other = video.rename(video.with_name(os.fsdecode(b"film\xff.avi")))
    with pytest.raises(DatasetError, match="its name is not in UTF-8, which OpenCV does not open; rename the file"):
        Film(other).opened()


def test_a_bomb_of_an_image_is_refused(tmp_path: Path) -> None:
    """The head of a PNG states 60,000 x 60,000 pixels."""
    folder = write_images(tmp_path / "images", [1, 2])
    head = b"IHDR" + struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0)
    bomb = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head))
    (folder / "frame2.png").write_bytes(bomb)
    assert levels(Film(folder, 100.0)) == [(0, 30.0), (1, None)]
    (folder / "frame1.png").write_bytes(bomb)
    with pytest.raises(DatasetError, match=r"frame1\.png: cannot be read as an image; save it as PNG"):
        Film(folder, 100.0).opened()


@pytest.mark.parametrize("channels", [3, 4])
def test_coloured_images_become_grey(tmp_path: Path, channels: int) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    colours = np.zeros((*SIZE[::-1], channels), np.uint8)
    colours[..., 2] = 200  # red
    cv2.imwrite(str(folder / "1.png"), colours)
    ((_, shown),) = levels(Film(folder, 100.0))
    assert shown == pytest.approx(0.299 * 200, abs=1)


def test_a_video_is_read_back(video: Path) -> None:
    frames = Film(video).opened()
    assert (frames.size_px, frames.rate_hz, frames.count) == (SIZE, 25.0, 12)
    shown = levels(Film(video))
    assert [number for number, _ in shown] == list(range(12))
    assert [value for _, value in shown] == pytest.approx([10 * number + 20 for number in range(12)], abs=2)
    assert levels(Film(video), 7) == shown[7:]
    assert Film(video, 480.0).opened().rate_hz == 480.0


@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan"), float("inf"), 1e7])
def test_a_rate_that_cannot_be_is_refused(video: Path, rate: float) -> None:
    with pytest.raises(DatasetError, match=r"film\.avi.*above 0.*frames per second"):
        Film(video, rate).opened()


def test_what_holds_no_frames_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"no file or folder; state the path"):
        Film(tmp_path / "missing.avi").opened()
    (tmp_path / "text.avi").write_text("no video")
    with pytest.raises(DatasetError, match=r"cannot be read as a video.*\.mp4"):
        Film(tmp_path / "text.avi").opened()
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match=r"holds no images.*\.png"):
        Film(tmp_path / "empty", 10.0).opened()
    folder = write_images(tmp_path / "images", [1])
    with pytest.raises(DatasetError, match=r"no frame rate; state rate_hz"):
        Film(folder).opened()
    (folder / "frame0.png").write_bytes(b"torn")
    with pytest.raises(DatasetError, match=r"frame0\.png: cannot be read as an image"):
        Film(folder, 10.0).opened()
