"""Flashes of a strobe in frames of a rolling shutter, of which each row is exposed until it is read.

Row r of frame f is read at ``f / RATE + r * ROW``; a flash lights the rows read after it, in the first frame, and those
above, in the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from wingfit.cameras.video.source import Frames
from wingfit.cameras.video.strobe import Flash, FlashMark, FlashTimes, background, flash_times, flashes
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError

RATE, SIZE, ROW = 60.0, (40, 120), 1e-4  # rows take 12 of 16.7 ms
DARK, LIT = 12.0, 120.0


class Film(Frames):
    """Frames of flashes at given times (s); rows with markers are those in ``seen``."""

    def __init__(
        self, times: Sequence[float] | Array, count: int, seen: Array | None = None, noise: float = 1.0
    ) -> None:
        self.path, self.size_px, self.rate_hz, self.count = Path("film.avi"), SIZE, RATE, count
        self.wing = np.zeros(SIZE[::-1])
        self.wing[np.arange(SIZE[1]) if seen is None else seen, 5:35] = LIT
        self.times, self.noise = np.asarray(times, dtype=float), noise

    def read(self, first: int = 0) -> Iterator[tuple[int, Array | None]]:
        for number in range(first, self.count):
            yield number, self.frame(number)

    def frame(self, number: int) -> Array | None:
        read = number / RATE + np.arange(SIZE[1]) * ROW
        light = ((self.times[:, None] <= read) & (self.times[:, None] > read - 1 / RATE)).sum(0)
        noise = self.noise * np.random.default_rng([9, number]).standard_normal(self.wing.shape)
        return np.asarray(np.clip(np.rint(DARK + light[:, None] * self.wing + noise), 0, 255), dtype=np.uint8)


def found(film: Film, first: int = 0) -> list[Flash]:
    return list(flashes(film, background(film), first))


def timed(film: Film, row_s: float | None = None) -> FlashTimes:
    return flash_times([one.mark for one in found(film)], film, row_s)


def steady(count: int, period: float, start: float = 0.05) -> Array:
    return np.asarray(start + period * np.arange(count), dtype=float)


def test_the_halves_of_a_flash_are_merged() -> None:
    """The rows that each frame shows are complementary, and their sum is the whole wing."""
    film = Film([0.2 - 0.5 * ROW, 0.5 + 29.5 * ROW, 0.8 + 87.5 * ROW], 60)
    marks = [(12, 0.0), (30, 30.0), (48, 88.0)]
    shown = found(film)
    assert [one.mark.frame for one in shown] == [frame for frame, _ in marks]
    for one, (_, split) in zip(shown, marks, strict=True):
        assert one.image == pytest.approx(film.wing, abs=7)
        assert one.noise == pytest.approx(np.sqrt(2), rel=0.1)
        assert one.mark.split == pytest.approx(split, abs=0.51)
    assert shown[1].mark.between == (29.0, 30.0)


def test_a_split_between_markers_has_a_range() -> None:
    seen = np.r_[10:20, 60:70]
    (one,) = found(Film([0.5 + 39.5 * ROW], 60, seen))
    assert one.mark.between == (19.0, 60.0)
    assert one.mark.split == 39.5
    (one,) = found(Film([0.5 - 0.5 * ROW], 60, seen))  # before all markers
    assert one.mark.between == (-np.inf, 10.0)
    (one,) = found(Film([0.5 + 68.5 * ROW], 60, seen))  # within the second ones
    assert one.mark.between == (68.0, 69.0)


def test_an_unreadable_second_frame_leaves_the_first() -> None:
    class Torn(Film):
        def frame(self, number: int) -> Array | None:
            return None if number == 31 else super().frame(number)

    one, two = found(Torn([0.5 + 29.5 * ROW, 0.8 + 0.5 * ROW], 60))
    assert one.image[35:, 5:35].min() > LIT - 8
    assert np.abs(one.image[:30]).max() < 8
    assert two.image == pytest.approx(Film([], 1).wing, abs=7)


@pytest.mark.parametrize("period", [3, 4, 5, 6, 7, 12, 18, 36])
@pytest.mark.parametrize("count", [60, 90, 130, 400])
def test_the_background_is_dark_if_the_strobe_is_in_step_with_the_frames(period: int, count: int) -> None:
    """Frames are sampled, and those must not all be lit: at 10 Hz and 60 frames per second every sixth is."""
    film = Film(steady(int(count / period), period / RATE, 0.004), count)
    dark = background(film)
    assert dark.image == pytest.approx(np.full(SIZE[::-1], DARK), abs=6)
    assert len(list(flashes(film, dark))) == int(count / period)


def test_times_and_row_time_follow_from_many_flashes() -> None:
    """A period of 19.35 frames puts the splits at all rows."""
    times = steady(40, 19.35 / RATE)
    film = Film(times, 800)
    result = timed(film)
    assert result.row_s == pytest.approx(ROW, rel=0.01)
    assert result.period == pytest.approx(times[1] - times[0], rel=1e-5)
    assert list(result.numbers) == list(range(40))
    # The time of a row and the start are known to about a row, as the frames do not show more.
    assert result.times == pytest.approx(times, abs=1.5 * ROW)
    assert result.standard_deviation < ROW
    stated = timed(film, ROW)
    assert stated.times == pytest.approx(times, abs=ROW)
    assert stated.row_s == ROW


def test_times_are_right_with_markers_in_few_rows() -> None:
    times = steady(60, 19.35 / RATE)
    result = timed(Film(times, 1200, np.r_[30:36, 50:56, 80:86]), ROW)
    assert result.period == pytest.approx(times[1] - times[0], rel=1e-4)
    assert result.times == pytest.approx(times, abs=1e-3)


def test_flashes_that_were_not_seen_leave_gaps_in_the_numbers() -> None:
    times = steady(60, 19.35 / RATE)
    kept = np.r_[0:20, 55:60]
    result = timed(Film(times[kept], 1200), ROW)
    assert list(result.numbers) == list(kept)
    assert result.times == pytest.approx(times[kept], abs=1.5 * ROW)


def test_a_global_shutter_has_no_row_time() -> None:
    marks = [FlashMark(frame, 10.0, (-np.inf, 10.0)) for frame in (3, 13, 23, 33, 43, 53)]
    result = flash_times(marks, Film([], 60), None)
    assert result.row_s == 0.0
    assert result.period == pytest.approx(10 / RATE)


def test_continuous_light_is_no_strobe() -> None:
    class Moving(Film):
        def frame(self, number: int) -> Array | None:
            image = np.full(SIZE[::-1], int(DARK), np.uint8)
            image[:, (3 * number) % 30 : (3 * number) % 30 + 6] = int(LIT)
            return image

    with pytest.raises(DatasetError, match=r"third of three that are lit.*third of the frame rate.*light: continuous"):
        found(Moving([], 60))


def test_an_irregular_strobe_is_refused() -> None:
    times = steady(20, 0.3)
    times[13] += 0.12
    with pytest.raises(DatasetError, match=r"frame \d+ is \d+\.\d ms off a steady strobe, more than two frames"):
        timed(Film(times, 420), ROW)


def test_few_flashes_and_short_films_are_refused() -> None:
    with pytest.raises(DatasetError, match="shows 2 flashes; the period of a strobe takes three"):
        timed(Film(steady(2, 0.3), 60))
    with pytest.raises(DatasetError, match="has 3 frames; the background takes 5"):
        background(Film([], 3))


def test_flashes_go_on_from_a_later_frame() -> None:
    film = Film(steady(6, 0.3), 120)
    whole, dark = found(film), background(film)
    later = list(flashes(film, dark, whole[2].mark.frame + 2))
    assert [one.mark for one in later] == [one.mark for one in whole[3:]]
    assert np.array_equal(later[0].image, whole[3].image)
