"""Choosing markers and rows, rows that have the same time, and columns in different units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.importers.reading import read, refused
from wingfit import import_tracks

HAWKS = Path(__file__).parents[3] / "shared" / "data" / "hawk"
HEADER = "time_s,tip_x_m,tip_y_m,tip_z_m,root_x_m,root_y_m,root_z_m\n"


def rows(*times: float, other: tuple[int, ...] = ()) -> str:
    """A table of two markers; in the rows ``other``, the tip is elsewhere."""
    lines = [f"{time:g},{5 if k in other else 1},2,3,4,5,6" for k, time in enumerate(times)]
    return HEADER + "\n".join(lines) + "\n"


REPEATED = rows(0, 0.1, 0.2, 0.2, 0.3, 0.4, 0.4, 0.5, 0.6, 0.7, other=(3,))


def test_only_the_named_markers_are_imported() -> None:
    found = read(rows(*np.arange(10) / 10), markers="t*")
    assert found.markers == ("tip",)
    assert any("1 marker that --markers does not name (root)" in one for one in found.remarks)
    assert read(rows(*np.arange(10) / 10), markers="root,tip").markers == ("tip", "root")
    assert "no marker is called 'tpi' (did you mean 'tip'?)" in refused(rows(*np.arange(10) / 10), markers="tpi,root")


def test_what_repeats_is_said_with_the_remedy() -> None:
    message = refused(REPEATED)
    assert "2 times stand in more than one line, the first (0.2 s) in lines 4 and 5" in message
    assert "differ in the positions of tip;" in message
    assert "--repeated gaps" in message
    same = refused(rows(0, 0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7))
    assert "one time stands in more than one line" in same
    assert "with the same positions" in same


def test_rows_with_the_same_time_are_merged_with_gaps_where_they_differ() -> None:
    found = read(REPEATED, repeated="gaps")
    assert found.times.tolist() == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    assert np.isnan(found.positions[2, 0]).all()
    assert found.positions[2, 1].tolist() == [4, 5, 6]
    assert np.isfinite(found.positions[4]).all(), "equal positions are one"
    first = read(REPEATED, repeated="first")
    assert first.positions[2, 0].tolist() == [1, 2, 3]
    assert any("in 2 rows the time is that of the row before" in one for one in first.remarks)


def test_a_position_that_only_one_of_the_rows_has_is_kept() -> None:
    text = REPEATED.replace("0.2,1,2,3", "0.2,,,")
    assert read(text, repeated="gaps").positions[2, 0].tolist() == [5, 2, 3]


def test_all_questions_are_put_at_once_with_the_recordings_to_choose() -> None:
    lines = [f"{run},{t},1,2,3" for run in ("a", "b") for t in range(10)]
    message = refused("run,time,tip_x,tip_y,tip_z\n" + "\n".join(lines))
    assert "--unit m " in message, "an example that fits the numbers"
    assert "they are numbers from 1 to 3" in message
    assert "--time-unit" in message
    assert "--rows run=a (or run=b)" in message


def test_columns_of_one_marker_in_different_units_are_named() -> None:
    message = refused("time_s,tip_x_mm,tip_y_m,tip_z_mm,r_x_mm,r_y_mm,r_z_mm\n0,1,2,3,4,5,6\n")
    assert "marker 'tip' state different units (tip_x_mm, tip_y_m, tip_z_mm); write all in one unit" in message


@pytest.mark.skipif(not HAWKS.is_dir(), reason="the recordings of hawks are not there")
def test_the_flight_of_a_hawk_that_repeats_times_says_which_and_is_read() -> None:
    path = HAWKS / "2024-06-03-TestUnilateralMarkers.csv"
    options = {"unit": "m", "time_unit": "s", "rows": "seqID=02_07_074,Left=1"}
    with pytest.raises(ValueError, match=r"3 times stand in more than one line.*positions of wingtip_rot; merge"):
        import_tracks(path, **options)  # type: ignore[arg-type]
    found = import_tracks(path, repeated="gaps", **options)  # type: ignore[arg-type]
    assert (len(found.times), found.gaps.total) == (128, 3)
