"""The long films of the benchmark: short ones whose detections are repeated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cv2")

from benchmarks.cameras.long import FRAMES_PER_FLASH, RATE_HZ, _marks, _replay
from tests.cameras.track.test_between_frames import filmed
from wingfit.cameras.markers.stored import DetectionStore
from wingfit.cameras.track.film_detections import FilmDetections
from wingfit.cameras.video.source import Frames
from wingfit.cameras.video.strobe import flash_times


def test_the_flashes_are_those_of_a_steady_strobe() -> None:
    frames = Frames()
    frames.path, frames.size_px, frames.rate_hz, frames.count = Path("film"), (1920, 1080), RATE_HZ, 700
    found = flash_times(list(_marks("strobe", 200, 1080)), frames, None)
    assert found.period == pytest.approx(FRAMES_PER_FLASH / RATE_HZ, rel=1e-6)
    assert found.standard_deviation < 1e-6
    assert found.row_s == pytest.approx(1 / RATE_HZ / 1080, rel=1e-3)
    assert np.array_equal(found.numbers, np.arange(200))


def test_a_film_in_continuous_light_is_repeated(tmp_path: Path) -> None:
    seen, _ = filmed(0.0, 7)
    store = DetectionStore(tmp_path)
    _replay(FilmDetections(seen, [], ()), store, "continuous", _marks("continuous", 20, 1080))
    assert [mark.frame for mark in store.marks()] == list(range(20))
    for number, one in enumerate(store.seen()):
        assert np.array_equal(one.pixels, seen[number % 7].pixels)
