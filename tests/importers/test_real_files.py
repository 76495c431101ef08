"""Recordings of other laboratories, which are not part of the project."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wingfit import DatasetError, import_tracks

DATA = Path(__file__).parents[2].parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the folder ../shared with recordings of others is not there")


def test_c3d_of_a_walk() -> None:
    found = import_tracks(DATA / "mocap" / "optitrack_walking.c3d")
    assert (found.format, len(found.markers), len(found.times), found.gaps.residual) == ("c3d", 12, 3361, 2996)
    assert found.rate_hz == pytest.approx(160)
    assert np.nanmax(np.abs(found.positions)) < 2


def test_the_c3d_has_the_numbers_that_another_library_reads() -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    path = DATA / "mocap" / "optitrack_walking.c3d"
    theirs = ezc3d.c3d(str(path))["data"]["points"][:3].transpose(2, 1, 0)
    assert np.allclose(import_tracks(path).positions * 1e3, theirs, atol=1e-9, rtol=0, equal_nan=True)


def test_trc_of_which_the_end_is_missing() -> None:
    path = DATA / "mocap" / "markers.trc"
    with pytest.raises(DatasetError, match="has 93 frames, but states 652"):
        import_tracks(path)
    found = import_tracks(path, incomplete=True)
    assert (found.format, len(found.markers)) == ("trc", 51)
    assert found.rate_hz == pytest.approx(100)
    assert found.positions[0, 0].tolist() == pytest.approx([0.7337041, 0.0809832, 0.1918668])


def test_hawks() -> None:
    path = DATA / "hawk" / "2024-06-03-TestBilateralMarkers.csv"
    with pytest.raises(DatasetError, match="--unit"):
        import_tracks(path)
    with pytest.raises(DatasetError, match="--rows"):
        import_tracks(path, unit="m", time_unit="s")
    found = import_tracks(path, unit="m", time_unit="s", rows="seqID=01_09_017_2", axes="x out, y fore, z up")
    assert (len(found.markers), len(found.times)) == (8, 90)
    assert found.rate_hz == pytest.approx(200)


def test_digitised_puffins_have_no_points_in_this_file() -> None:
    path = DATA / "alcid" / "puffin_xyzpts.csv"
    with pytest.raises(DatasetError, match="--rate-hz"):
        import_tracks(path)
    with pytest.raises(DatasetError, match="no marker is seen in any of 464 frames"):
        import_tracks(path, unit="m", rate_hz=400)
