"""The file cameras.yaml: what is written is read back, and what is wrong is named with its line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cameras.calibrate.simulated import LENSES
from tests.cameras.files.samples import assert_same, cameras, with_covariance
from wingfit.cameras.camera import Lens, LensModel
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import write_cameras
from wingfit.cameras.files.read import read_cameras
from wingfit.records.errors import DatasetError


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    path, written = tmp_path / "new" / "cameras.yaml", with_covariance()
    write_cameras(path, written)
    found = read_cameras(path)
    assert_same(found.cameras, written.cameras)
    assert [one.name for one in found.cameras] == [one.name for one in written.cameras]
    assert [one.lens for one in found.cameras] == [one.lens for one in written.cameras]
    assert found.covariance is not None
    np.testing.assert_array_equal(found.covariance, written.covariance)
    write_cameras(path, CameraSet(cameras()))
    assert read_cameras(path).covariance is None
    assert [one.name for one in path.parent.iterdir()] == ["cameras.yaml"]


def test_a_file_that_was_read_is_written_unchanged(tmp_path: Path) -> None:
    first, second = tmp_path / "1.yaml", tmp_path / "2.yaml"
    write_cameras(first, with_covariance())
    write_cameras(second, read_cameras(first))
    again = read_cameras(second)
    assert_same(again.cameras, cameras())
    assert again.covariance is not None
    np.testing.assert_array_equal(again.covariance, read_cameras(first).covariance)


def test_units_stand_in_the_names(tmp_path: Path) -> None:
    path = tmp_path / "cameras.yaml"
    write_cameras(path, CameraSet(cameras()))
    text = path.read_text()
    assert "row_us: 12.5" in text
    assert "size_px: [1024, 800]" in text
    assert "focal_px: [900.123456789, 901.0]" in text


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("version: 1", "version: 2", r"'wingfit cameras 2' is not 'wingfit cameras' version 1"),
        ("focal_px: [900", "focal_px: [-900", "focal length -900.123 px; it must lie in"),
        (
            "focal_px: [900.123456789, 901.0]",
            "focal_px: [900.1]",
            r"line \d+, column \d+: cameras\[0\].focal_px.*a list of 2",
        ),
        ("row_us: 12.5", "row_us: -1", "time between rows -1e-06 s; it must be 0"),
        (
            "row_us: 12.5",
            "row_us: 2500",
            "2500 us from row to row make 2 s for 800 rows; at most 1 s: state row_us in micro",
        ),
        ("centre_px: [511.5,", "centre_px: [1e9,", r"principal point 1e\+09, 399.5 px; it must lie in"),
        (
            "rotation_rad: [",
            "rotation_rad: [45.0, 0, 0] # [",
            "45 rad; at most 6.283: state the rotation vector in radians",
        ),
        (
            "{model: brown, k1: -0.",
            "{model: brown, k1: 1e30, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0} # ",
            r"the lens has k1 = 1e\+30, .* at most 1000: calibrate again",
        ),
        ("row_us: 12.5", "row_s: 12.5", r"cameras\[3\].row_us: the key 'row_us' is missing"),
        ("name: camera 1", "name: camera 0", "two cameras have the same name"),
        ("name: camera 1", "name: 7", r"cameras\[1\].name: 7 is no text"),
        ("model: fisheye", "model: fishey", "fishey is no model of a lens; did you mean 'fisheye'"),
        ("model: pinhole", "model: pinhole, k1: 0.1", r"unknown key 'k1'"),
        ("[1024, 800]", "[1024.5, 800]", "whole numbers of pixels"),
        ("[1024, 800]", "[0, 800]", "size 0 x 800 px"),
        ("translation_m: [0.01,", "translation_m: [20000,", "the origin is 20000 m from the camera, at most 10000 m"),
        ("translation_m: [0.01,", "translation_m: [.nan,", "is no finite number"),
        ("- camera 0.f_y", "- camera 0.f_x", "camera 0.f_x stands where camera 0.f_y is expected"),
    ],
)
def test_errors_name_line_value_and_remedy(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "cameras.yaml"
    write_cameras(path, with_covariance())
    text = path.read_text()
    if old not in text:
        text = text.replace("[camera 0.f_x, camera 0.f_y,", "[camera 0.f_x, camera 0.f_x,")
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(DatasetError, match=message):
        read_cameras(path)


def test_a_covariance_that_cannot_be_is_refused(tmp_path: Path) -> None:
    given = with_covariance()
    assert given.covariance is not None
    wrong = given.covariance.copy()
    wrong[0, 1] = wrong[1, 0] = 2 * np.sqrt(wrong[0, 0] * wrong[1, 1])
    for covariance, message in (
        (wrong, "larger than its variances allow"),
        (given.covariance[:-1, :-1], "the cameras have"),
        (-given.covariance, "a variance negative"),
    ):
        with pytest.raises(DatasetError, match=message):
            write_cameras(tmp_path / "cameras.yaml", replace(given, covariance=covariance))
    assert not list(tmp_path.iterdir())


def test_two_cameras_at_one_place_are_refused(tmp_path: Path) -> None:
    one, other = cameras()[:2]
    moved = replace(one, name="moved", translation=one.translation + np.array([0, 0, 5e-4]))
    with pytest.raises(DatasetError, match=r"camera 0 and moved are 0\.5 mm apart; at least 1 mm: check the unit of"):
        write_cameras(tmp_path / "cameras.yaml", CameraSet((one, other, moved)))


@pytest.mark.parametrize("model", LENSES)
def test_strong_distortion_is_no_fault(model: LensModel, tmp_path: Path) -> None:
    """Lenses of 10 mm and more have large coefficients, which act on small angles."""
    narrow = next(one for one in cameras() if one.lens.model == model)
    matrix = narrow.matrix * [[12.0, 1, 1], [1, 12.0, 1], [1, 1, 1]]
    lens = Lens(model, tuple(300.0 * value for value in narrow.lens.coefficients))
    write_cameras(tmp_path / "cameras.yaml", CameraSet((replace(narrow, matrix=matrix, lens=lens),)))


def test_a_rotation_that_is_none_is_not_written(tmp_path: Path) -> None:
    one = replace(cameras()[0], rotation=np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(DatasetError, match="no rotation matrix"):
        write_cameras(tmp_path / "cameras.yaml", CameraSet((one,)))


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "cameras.yaml"
    write_cameras(path, CameraSet(cameras()))
    before = path.read_bytes()

    def fails(*_: object) -> None:
        raise OSError("no space")

    monkeypatch.setattr(Path, "replace", fails)
    with pytest.raises(OSError, match="no space"):
        write_cameras(path, CameraSet(cameras()[:1]))
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["cameras.yaml"]
