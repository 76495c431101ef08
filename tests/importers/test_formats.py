"""Every format: what is read is what was written, and what is not stated must be given."""

from __future__ import annotations

import numpy as np
import pytest

from tests.importers.reading import read, refused
from tests.oracles.track_files import Case, Truth, cases, flapping, guessed, measure, text_writers
from wingfit.importers.readers import READERS

CASES = [*cases(0), *cases(1)]


@pytest.mark.parametrize("case", CASES, ids=[f"{k}-{case.format}" for k, case in enumerate(CASES)])
def test_what_is_read_is_what_was_written(case: Case) -> None:
    assert measure(case) <= 1e-4


def test_every_format_is_tested() -> None:
    assert {case.format for case in CASES} == set(READERS)


def test_nothing_is_guessed() -> None:
    tried, silent, notes = guessed(0, None)
    assert set(tried) == set(READERS)
    assert sum(silent.values()) == 0, notes


def test_who_stated_what_is_in_the_result() -> None:
    found = read(text_writers.qualisys(flapping()), unit="mm", axes="x aft, y out, z up")
    by = {one.fact: (one.by, one.where) for one in found.statements}
    assert by["unit"] == ("user", "--unit")
    assert by["rate"] == ("file", "line 4, FREQUENCY")
    assert by["axes"] == ("user", "--axes")
    assert found.frame == "wing"


def test_tracks_stay_in_the_axes_of_the_file_unless_the_user_says_how_the_wing_lies() -> None:
    content = text_writers.trc(flapping())
    as_is, turned = read(content), read(content, axes="x up, y in, z aft")
    assert as_is.frame == "file"
    assert any("--axes" in remark for remark in as_is.remarks)
    expected = np.stack([as_is.positions[..., 2], -as_is.positions[..., 1], as_is.positions[..., 0]], axis=-1)
    assert np.array_equal(turned.positions, expected, equal_nan=True)


def with_names(*names: str) -> Truth:
    one = flapping(gaps=False)
    return Truth(names, one.rate, one.mm[:, : len(names)])


def test_unlabelled_markers_are_counted_and_not_imported() -> None:
    content = text_writers.trc(with_names("tip", "*12", "Unlabeled 1001", "New 0001"))
    found = read(content)
    assert found.markers == ("tip",)
    assert any("3 unlabelled" in remark for remark in found.remarks)
    assert read(content, keep_unlabelled=True).markers == ("tip", "12", "Unlabeled_1001", "New_0001")
    assert "unlabelled" in refused(text_writers.trc(with_names("*1", "*2")))


def test_names_fit_a_dataset_and_changes_are_reported() -> None:
    found = read(text_writers.trc(with_names("Flügel 1", "Bird:tip", "a/b", "a b")))
    assert found.markers == ("Flugel_1", "Bird_tip", "a_b", "a_b-2")
    assert found.labels == ("Flügel 1", "Bird:tip", "a/b", "a b")
    assert any("'Flügel 1' is now Flugel_1" in remark for remark in found.remarks)


def test_a_name_that_is_used_twice_is_refused() -> None:
    assert "2 markers are called 'tip'" in refused(text_writers.trc(with_names("tip", "root", "tip")))


def test_columns_that_are_no_measured_markers_are_not_imported() -> None:
    found = read(text_writers.motive(flapping()))
    assert found.markers == flapping().names
    assert "not imported: 3 columns of Rigid Body Marker (Position)" in found.remarks
    assert "not imported: section Devices" in read(text_writers.vicon(flapping())).remarks


def test_expected_places_of_rigid_bodies_alone_are_refused() -> None:
    content = text_writers.motive(flapping()).replace(",Marker", ",Bone Marker")
    assert "no columns of type Marker" in refused(content)
    assert "Global" in refused(text_writers.motive(flapping()).replace("Space,Global", "Space,Local"))


def test_columns_of_a_plain_table_can_be_stated() -> None:
    content = "clock,u,v,w\n" + "".join(f"{t},1,2,{t}\n" for t in range(10))
    assert "--columns" in refused(content)
    found = read(content, columns="time=clock; tip=w,v,u", unit="m", time_unit="ms")
    assert found.markers == ("tip",)
    assert found.times[3] == 0.003
    assert found.positions[4, 0].tolist() == [4.0, 2.0, 1.0]
    assert "no column 'q'" in refused(content, columns="tip=q,v,u", unit="m", rate_hz=1)
    assert "2 columns; give three" in refused(content, columns="tip=v,u", unit="m", rate_hz=1)
    assert "is not NAME=VALUE" in refused(content, columns="tip:v,u", unit="m", rate_hz=1)
    assert "--columns" in refused(text_writers.trc(flapping()), columns="tip=u,v,w")


def test_rows_of_a_plain_table_can_be_chosen() -> None:
    rows = [f"{run},{t / 10},{run},{t},0.5" for run in ("a", "b") for t in range(10)]
    content = "run,time_s,tip_x_m,tip_y_m,tip_z_m\n" + "\n".join(rows).replace(",a,", ",1,").replace(",b,", ",2,")
    assert "line 12, column 'time_s': 0 s follows 0.9 s" in refused(content)
    assert read(content, rows="run=b").positions[0, 0].tolist() == [2.0, 0.0, 0.5]
    assert "--rows: no row has these values (20 rows read)" in refused(content, rows="run=c")
    assert "no column 'walk'" in refused(content, rows="walk=c")


def test_gaps_have_a_cause() -> None:
    content = "time_s,a_x_m,a_y_m,a_z_m\n0,1,2,3\n1,,,\n2,NaN,nan(ind),-1.#IND\n3,0,0,0\n4,1,,3\n" + "".join(
        f"{t},1,2,3\n" for t in range(5, 10)
    )
    gaps = read(content).gaps
    assert (gaps.empty, gaps.nan, gaps.zeros, gaps.partial, gaps.residual, gaps.total) == (1, 1, 1, 1, 0, 4)
    assert read(content, keep_zeros=True).gaps.zeros == 0


def test_a_marker_that_is_never_seen_is_left_out() -> None:
    truth = with_names("tip", "ghost")
    truth.mm[:, 1] = np.nan
    found = read(text_writers.trc(truth))
    assert found.markers == ("tip",)
    assert any("ghost" in remark for remark in found.remarks)
    truth.mm[:] = 0
    assert "--keep-zeros" in refused(text_writers.trc(truth))


@pytest.mark.parametrize("times", [False, True])
@pytest.mark.parametrize("tab", [False, True])
def test_rows_of_qualisys_may_end_with_a_tab(times: bool, tab: bool) -> None:
    truth = flapping()
    truth.mm[:, -1] = np.nan
    truth.mm[-5:, -1] = 7.0
    lines = text_writers.qualisys(truth, times=times).splitlines()
    content = "\n".join(line + "\t" * (tab and not line[0].isalpha()) for line in lines)
    found = read(content, unit="mm")
    assert np.allclose(found.positions * 1e3, truth.mm, atol=1e-9, equal_nan=True)
    assert (found.statement("times") is not None) == times


def test_names_above_the_columns_must_fit_them() -> None:
    content = text_writers.motive(flapping())
    assert "describes" in refused(content.replace(",Marker", "", 1))
    vicon = text_writers.vicon(flapping(), devices=False)
    assert "is 'Q'; a column must be X, Y, Z" in refused(vicon.replace("Frame,X,Y,Z,X", "Frame,X,Y,Z,Q"))
    assert "side by side" in refused(vicon.replace("Frame,X,Y,Z", "Frame,X,Z,Y"))
    assert "the units m, mm differ" in refused(vicon.replace(",,mm", ",,m"))


def test_velocities_of_vicon_are_not_imported() -> None:
    truth = with_names("tip")
    rows = [f"{t + 1},0,{x:.3f},{y:.3f},{z:.3f},0,0,0\n" for t, (x, y, z) in enumerate(truth.mm[:, 0])]
    head = "Trajectories\n240\n,,tip,,,,,\nFrame,Sub Frame,X,Y,Z,X',Y',Z'\n,,mm,mm,mm,mm/s,mm/s,mm/s\n"
    found = read(head + "".join(rows))
    assert np.allclose(found.positions * 1e3, truth.mm, atol=1e-9)
    assert "not imported: velocities and accelerations" in found.remarks
