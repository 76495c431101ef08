"""A recording that is missed far more than the others."""

from __future__ import annotations

import pytest

from wingfit.diagnosis.finding import Interval, RecordingMisfit
from wingfit.diagnosis.verdict.build_finding import _outlying


def rows(*misfits: float, frequency: float | None = 12.5) -> list[RecordingMisfit]:
    """Recordings a, b, ... with these misfits (N) and a floor of 2 mN; the nominal model misses all by 1 N."""
    return [
        RecordingMisfit(
            chr(ord("a") + k),
            k == 0,
            frequency,
            None,
            None,
            None,
            Interval(1.0, 1.0, 1.0),
            Interval(one, one, one),
            2e-3,
        )
        for k, one in enumerate(misfits)
    ]


@pytest.mark.parametrize("place", range(4))
def test_it_gets_a_remark_wherever_it_is(place: int) -> None:
    misfits = [2e-3, 3e-3, 4e-3]
    misfits.insert(place, 89e-3)
    (remark,) = _outlying(rows(*misfits), "N")
    assert f"misses {'abcd'[place]} by 89 mN, and half of the others by 3 mN or less" in remark
    assert not _outlying(rows(*misfits), "N", {"abcd"[place]}), "the summary names it"


@pytest.mark.parametrize("misfits", [(2e-3, 3e-3, 9e-3), (0.1e-3, 0.1e-3, 9e-3), (80e-3, 82e-3, 89e-3), (2e-3, 89e-3)])
def test_others_get_none(misfits: tuple[float, ...]) -> None:
    """Not far beyond the others, or beyond the floor; and of two, none is the exception."""
    assert _outlying(rows(*misfits), "N") == ()


def test_a_series_gets_none() -> None:
    assert _outlying(rows(2e-3, 2e-3, 89e-3, frequency=None), "N") == ()
