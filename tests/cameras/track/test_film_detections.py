"""Detections of a whole film: runs that were interrupted go on, and give the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.cameras.markers.drawing import disc, drawn, noisy
from wingfit.cameras.markers import stored
from wingfit.cameras.track.film_detections import FilmDetections, FilmTask, detect_film
from wingfit.cameras.video.source import Film
from wingfit.records.errors import DatasetError

SIZE, FRAMES, TORN = (72, 56), 31, (12, 30)


class StoppedError(Exception):
    """Raised by a progress callback."""


@pytest.fixture(autouse=True)
def short_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored, "BLOCK", 5)


@pytest.fixture(scope="module")
def steady(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two dots that move, under light whose noise grows, so that each frame has another one; two frames are torn."""
    folder, rng = tmp_path_factory.mktemp("steady") / "film", np.random.default_rng(3)
    folder.mkdir()
    for number in range(FRAMES):
        places = [np.array([15 + 0.7 * number, 20.0]), np.array([50.0, 15 + 0.6 * number])]
        image = noisy(drawn(SIZE, [(disc, place, 5.0 * np.eye(2)) for place in places]), 1.0 + number / 8, rng)
        cv2.imwrite(str(folder / f"{number}.png"), image)
    for number in TORN:
        (folder / f"{number}.png").write_bytes(b"torn")
    return folder


@pytest.fixture(scope="module")
def flashed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve flashes, one in four frames, of which upper and lower rows are in two of them."""
    folder, rng = tmp_path_factory.mktemp("flashed") / "film", np.random.default_rng(4)
    folder.mkdir()
    places = [np.array([15.0, 14.0]), np.array([50.0, 40.0])]
    lit = drawn(SIZE, [(disc, place, 6.0 * np.eye(2)) for place in places], levels=(0.0, 150.0))
    for number in range(48):
        flash, part = divmod(number, 4)
        rows = np.arange(SIZE[1])[:, None]
        split = 3 * flash + 10
        shown = lit * (rows >= split if part == 1 else (rows < split) & (part == 2))
        cv2.imwrite(str(folder / f"{number}.png"), noisy(shown + 10, 1.0, rng))
    return folder


def silent(done: int, of: int) -> None:
    assert 0 < done <= of


def assert_same(one: FilmDetections, two: FilmDetections) -> None:
    assert list(one.marks) == list(two.marks)
    assert one.bad_frames == two.bad_frames
    assert len(one.seen) == len(two.seen)
    for left, right in zip(one.seen, two.seen, strict=True):
        assert np.array_equal(left.pixels, right.pixels)
        assert np.array_equal(left.covariance, right.covariance)
        assert np.array_equal(left.size_px, right.size_px)
        assert np.array_equal(left.contrast, right.contrast)


def interrupted(task: FilmTask, after: int) -> None:
    """Run ``task`` and stop after some instants."""
    calls = 0

    def stop(_done: int, _of: int) -> None:
        nonlocal calls
        calls += 1
        if calls == after:
            raise StoppedError

    with pytest.raises(StoppedError):
        detect_film(task, stop)


def test_all_frames_are_detected(steady: Path, tmp_path: Path) -> None:
    found = detect_film(FilmTask(Film(steady, 100.0), "dot", "continuous", tmp_path), silent)
    assert [mark.frame for mark in found.marks] == [number for number in range(FRAMES) if number not in TORN]
    assert found.bad_frames == TORN
    assert {len(seen) for seen in found.seen} == {2}
    part = detect_film(FilmTask(Film(steady, 100.0), "dot", "continuous", tmp_path, 5, 12), silent)
    assert [mark.frame for mark in part.marks] == list(range(5, 12))
    assert part.bad_frames == ()


@pytest.mark.parametrize("after", [3, 14])
def test_a_run_that_was_interrupted_goes_on(steady: Path, tmp_path: Path, after: int) -> None:
    stored = FilmTask(Film(steady, 100.0), "dot", "continuous", tmp_path / "interrupted")
    interrupted(stored, after)
    frames: list[int] = []
    again = detect_film(stored, lambda done, _of: frames.append(done))
    whole = detect_film(replace(stored, store=tmp_path), silent)
    assert_same(again, whole)
    # Whole chunks are not detected again.
    assert len(frames) == len(whole.seen) - after // 5 * 5
    assert_same(detect_film(stored, silent), whole)


@pytest.mark.parametrize("after", [4, 7])
def test_a_strobe_goes_on_after_its_last_flash(flashed: Path, tmp_path: Path, after: int) -> None:
    task = FilmTask(Film(flashed, 60.0), "dot", "strobe", tmp_path)
    whole = detect_film(task, silent)
    assert [mark.frame for mark in whole.marks] == list(range(1, 48, 4))
    assert {len(seen) for seen in whole.seen} == {2}
    stored = replace(task, store=tmp_path / "interrupted")
    interrupted(stored, after)
    assert_same(detect_film(stored, silent), whole)


def test_another_task_has_another_store(steady: Path, tmp_path: Path) -> None:
    task = FilmTask(Film(steady, 100.0), "dot", "continuous", tmp_path)
    others = [
        replace(task, film=Film(steady, 50.0)),
        replace(task, kind="chequer"),
        replace(task, light="strobe"),
        replace(task, first=1),
        replace(task, last=9),
    ]
    assert len({one.key for one in (task, *others)}) == 6


@pytest.mark.parametrize("damage", ["torn", "empty", "text", "other"])
def test_a_damaged_store_is_refused(steady: Path, tmp_path: Path, damage: str) -> None:
    task = FilmTask(Film(steady, 100.0), "dot", "continuous", tmp_path)
    detect_film(task, silent)
    chunk = tmp_path / task.key / "000001.npz"
    raw = chunk.read_bytes()
    if damage == "other":
        np.savez(chunk, counts=np.array([1]))
    else:
        chunk.write_bytes({"torn": raw[: len(raw) // 2], "empty": b"", "text": b"no archive"}[damage])
    with pytest.raises(DatasetError, match=r"000001\.npz: cannot be read .*; remove the folder, it is made anew"):
        detect_film(task, silent)


def test_an_image_that_is_replaced_makes_another_film(tmp_path: Path) -> None:
    folder = tmp_path / "film"
    folder.mkdir()
    for number in range(3):
        (folder / f"{number}.png").write_bytes(b"an image")
    task = FilmTask(Film(folder, 100.0), "dot", "continuous", tmp_path)
    before = task.key
    (folder / "1.png").write_bytes(b"another image")
    assert task.key != before


def cut_video(folder: Path, share: float) -> Path:
    """A video of 40 frames, of which the file ends after this share."""
    path = folder / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    image = drawn(SIZE, [(disc, np.array([30.0, 20.0]), 5.0 * np.eye(2))])
    rng = np.random.default_rng(3)
    for _ in range(40):
        writer.write(cv2.cvtColor(noisy(image, 2.0, rng), cv2.COLOR_GRAY2BGR))
    writer.release()
    raw = path.read_bytes()
    path.write_bytes(raw[: int(share * len(raw))])
    return path


def test_a_video_that_ends_early_says_where(tmp_path: Path) -> None:
    task = FilmTask(Film(cut_video(tmp_path, 0.7)), "dot", "continuous", tmp_path / "store")
    found = detect_film(task, silent)
    assert found.ended == len(found.seen)
    assert 24 <= found.ended <= 29
    # What was stored says so too, also where a run was interrupted before.
    assert detect_film(task, silent).ended == found.ended
    (tmp_path / "store" / task.key / "complete").unlink()
    assert detect_film(task, silent).ended == found.ended
    # Frames beyond the end were not wanted.
    assert detect_film(replace(task, last=found.ended), silent).ended is None
    assert detect_film(replace(task, last=found.ended + 2), silent).ended is None
    assert detect_film(replace(task, last=found.ended + 10), silent).ended == found.ended


def test_a_video_of_which_less_than_half_is_read_is_refused(tmp_path: Path) -> None:
    task = FilmTask(Film(cut_video(tmp_path, 0.4)), "dot", "continuous", tmp_path / "store")
    frames = sum(1 for _ in task.film.opened().read())
    assert 5 < frames < 20
    words = f"ends at frame {frames}, of 40 that the container states: .*Copy it again, or state last_frame: {frames}$"
    for _ in range(2):
        with pytest.raises(DatasetError, match=words):
            detect_film(task, silent)
    assert detect_film(replace(task, last=frames), silent).ended is None


def test_a_whole_video_and_images_end_where_they_say(steady: Path, tmp_path: Path) -> None:
    assert detect_film(FilmTask(Film(cut_video(tmp_path, 1.0)), "dot", "continuous", tmp_path), silent).ended is None
    assert detect_film(FilmTask(Film(steady, 100.0), "dot", "continuous", tmp_path), silent).ended is None
