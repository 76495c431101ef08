"""Long films: what is in memory does not grow with what was detected, and blocks do not change the tracks."""

from __future__ import annotations

import gc
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cameras.films import write_film
from tests.cameras.track.test_between_frames import RATE, filmed
from wingfit.cameras import triangulation
from wingfit.cameras.computed import Computed
from wingfit.cameras.markers import stored
from wingfit.cameras.markers.detections import Detections
from wingfit.cameras.markers.stored import BLOCK, DetectionStore
from wingfit.cameras.project import read_film
from wingfit.cameras.track import procedure
from wingfit.cameras.track.outliers import jumps
from wingfit.cameras.track.procedure import Request, track
from wingfit.cameras.track.result import TrackedFilm
from wingfit.cameras.track.tracklets import at_time, join
from wingfit.cameras.video.strobe import FlashMark
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError

FIELDS = ("times", "positions", "covariance", "by_calibration", "pixels", "residuals", "frames", "rejected")


@pytest.fixture(scope="module")
def request_of_film(tmp_path_factory: pytest.TempPathFactory) -> Request:
    """A short film, with cameras whose calibration is uncertain."""
    request = read_film(write_film(tmp_path_factory.mktemp("film"), frames=12))
    parameters = sum(len(camera.parameter_names) for camera in request.cameras)
    return replace(request, calibration=1e-8 * np.eye(parameters))


@pytest.fixture(scope="module")
def whole(request_of_film: Request) -> TrackedFilm:
    return track(request_of_film)


@pytest.mark.parametrize(("instants", "points"), [(5, 64), (1, 24)])
def test_blocks_do_not_change_the_tracks(
    request_of_film: Request, whole: TrackedFilm, instants: int, points: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored, "BLOCK", instants)
    monkeypatch.setattr(triangulation, "_BLOCK", points)
    found = track(request_of_film)
    assert found.csv() == whole.csv()
    assert (found.names, found.pixel_error, found.remarks) == (whole.names, whole.pixel_error, whole.remarks)
    for name in FIELDS:
        assert np.array_equal(getattr(found, name), getattr(whole, name), equal_nan=True), name


def test_what_was_detected_without_store_is_removed(
    request_of_film: Request, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    seen = list[int]()

    def report(step: str, _part: float) -> None:
        if step == "following":
            seen.append(len([*tmp_path.glob("wingfit-*/*/000000.npz")]))

    track(replace(request_of_film, last=8), report)
    assert set(seen) == {2}
    assert [*tmp_path.iterdir()] == []


def test_a_film_with_too_many_places_is_refused(request_of_film: Request, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(procedure, "MOST_PLACES", 90)
    words = r"8 instants of 12 markers are 96 places; at most 90 .* first_frame and last_frame \(not included\)"
    with pytest.raises(DatasetError, match=words):
        track(replace(request_of_film, last=8))


def test_detections_that_were_stored_are_read_block_by_block(tmp_path: Path) -> None:
    seen, _ = filmed(0.0, 3)
    store = DetectionStore(tmp_path)
    count = 20 * BLOCK + 7
    for number in range(count):
        store.add(FlashMark(number, 0.5, (-np.inf, 2.0)), seen[number % 3], (number,) if number % 100 == 3 else ())
    store.finish((), None)
    again, before = DetectionStore(tmp_path), _alive()
    read, marks = again.seen(), again.marks()
    assert (len(read), len(marks), again.complete, again.ended) == (count, count, True, None)
    assert again.bad_frames == list(range(3, count, 100))
    assert marks[count - 1] == FlashMark(count - 1, 0.5, (-np.inf, 2.0))
    most = 0
    for number, one in enumerate(read):
        assert np.array_equal(one.pixels, seen[number % 3].pixels)
        if number % 97 == 0:
            most = max(most, _alive() - before)
    assert 0 < most <= 6 * BLOCK


def test_a_film_that_ends_with_a_block_goes_on_where_it_stopped(tmp_path: Path) -> None:
    """Interrupted between its last block and the mark that it is complete, with bad frames behind that block."""
    seen, _ = filmed(0.0, 1)
    store = DetectionStore(tmp_path)
    for number in range(BLOCK):
        store.add(FlashMark(number, 0.5, (-np.inf, 2.0)), seen[0], ())
    store.finish((BLOCK,), None)
    (tmp_path / "complete").unlink()
    again = DetectionStore(tmp_path)
    assert not again.complete
    last = again.last()
    assert last is not None
    assert last.frame == BLOCK - 1
    again.finish((), 60)
    assert (len(DetectionStore(tmp_path).marks()), DetectionStore(tmp_path).ended) == (BLOCK, 60)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["000000.npz", "000001.npz", "complete"]


def test_a_store_that_cannot_be_written_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(DatasetError, match=r"No space left on device.*free the disk.*--store, TMPDIR"):
        DetectionStore(tmp_path).finish((3,), None)


def _alive() -> int:
    return sum(isinstance(one, Detections) for one in gc.get_objects())


def test_a_sequence_computes_what_is_read() -> None:
    calls = list[int]()

    def item(number: int) -> int:
        calls.append(number)
        return number**2

    numbers = Computed(6, item, kept=2)
    assert (len(numbers), numbers[5], numbers[5], numbers[-1], calls) == (6, 25, 25, 25, [5])
    assert [*numbers] == [0, 1, 4, 9, 16, 25]
    assert numbers[1:3] == [1, 4]
    with pytest.raises(IndexError):
        numbers[6]


class _Watched(Sequence[Detections]):
    """Frames of which those that are read are counted."""

    def __init__(self, frames: Sequence[Detections]) -> None:
        self.frames, self.read = frames, 0

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, number: Any) -> Any:
        self.read += 1
        return self.frames[number]


@pytest.mark.parametrize("row_s", [0.0, 1e-5])
def test_only_frames_near_a_time_are_read(row_s: float) -> None:
    """Frames that are far away do not change what is read, and cost nothing."""
    seen, times = filmed(row_s, 120)
    watched = _Watched(seen)
    long, part = join(watched, times, row_s), join(seen[40:80], times[40:80], row_s)
    for time in times[50] + np.array([0.0, 0.3, 0.77, 4.5]) / RATE:
        watched.read = 0
        one, two = at_time(long, time, 1.5 / RATE), at_time(part, time, 1.5 / RATE)
        assert watched.read < 20
        assert len(one) == 12
        assert np.array_equal(_sorted(one.pixels), _sorted(two.pixels))
        assert np.array_equal(_sorted(one.covariance[:, 0]), _sorted(two.covariance[:, 0]))


def _sorted(rows: Array) -> Array:
    return rows[np.lexsort(rows.T)]


def test_many_places_that_are_far_are_left_out_the_farthest_first() -> None:
    rng, count = np.random.default_rng(4), 400
    times = np.arange(count) / 100
    places = np.column_stack([np.sin(times), np.cos(times), times])[:, None] + 1e-4 * rng.standard_normal((count, 1, 3))
    wrong = np.arange(10, count - 10, 31)
    places[wrong] += 0.02 * (1 + rng.random((len(wrong), 1, 1)))
    spread = np.tile(1e-8 * np.eye(3), (count, 1, 1, 1))
    assert np.array_equal(np.flatnonzero(jumps(times, places, spread, 1e-3)[:, 0]), wrong)
