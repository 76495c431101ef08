"""What is said of the clock of a strobe, and of what its flashes do not show."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wingfit.cameras.track.instants import _clock_remarks
from wingfit.cameras.video.strobe import FlashTimes

RATE_HZ, PERIOD = 60.0, 0.3226


def remarks(row_s: float, period: float, count: int, between: tuple[float, float]) -> list[str]:
    """Remarks on two cameras, the second with a strobe of ``period`` (s) that divides ``between`` two rows."""

    def timed(row: float, of: float) -> FlashTimes:
        numbers = np.arange(float(count))
        return FlashTimes(np.asarray(of * numbers), numbers, of, 1e-6, row)

    seen: Any = SimpleNamespace(marks=[SimpleNamespace(between=between)] * count)
    cameras: Any = [SimpleNamespace(name=name) for name in ("left", "right")]
    films: Any = [SimpleNamespace(rate_hz=RATE_HZ)] * 2
    return _clock_remarks(cameras, films, [seen, seen], [timed(14e-6, PERIOD), timed(row_s, period)])


def test_an_unknown_time_of_rows_is_remarked_and_not_printed_as_zero() -> None:
    found = remarks(0.0, PERIOD, 9, (500.0, 510.0))
    assert "0.00 us" not in found[0]
    assert "14.00 us in left" in found[0]
    assert "film of right" in found[1]
    assert "exact to a frame, 16.7 ms" in found[1]


def test_a_global_shutter_has_no_time_of_rows() -> None:
    assert len(remarks(0.0, PERIOD, 9, (-np.inf, 3.0))) == 1


@pytest.mark.parametrize(("count", "remarked"), [(9, False), (90, True)])
def test_periods_that_differ_by_more_than_a_frame_are_remarked(count: int, remarked: bool) -> None:
    found = remarks(14e-6, PERIOD * 0.9974, count, (500.0, 510.0))
    assert any("differs by -0.26 %" in one for one in found) == remarked
