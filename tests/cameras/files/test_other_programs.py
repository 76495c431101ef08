"""Files of OpenCV and Anipose, and how formats are recognised."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.cameras.calibrate.simulated import ring
from tests.cameras.files.samples import assert_same, cameras
from wingfit.cameras.camera import Camera
from wingfit.cameras.files.read import read_cameras
from wingfit.records.errors import DatasetError

SIZE = (1024, 800)
DATA = Path(os.environ.get("OPENCV_DOC_DATA", "/usr/share/doc/opencv-doc/examples/data"))


def stored(path: Path, **values: int | np.ndarray) -> Path:
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        file.write(name, value)
    file.release()
    return path


def one_camera(path: Path, camera: Camera, **more: int) -> Path:
    coefficients = np.array(camera.lens.coefficients or np.zeros(5)).reshape(-1, 1)
    sizes = {"image_width": camera.size_px[0], "image_height": camera.size_px[1]}
    return stored(path, **sizes, camera_matrix=camera.matrix, distortion_coefficients=coefficients, **more)


@pytest.mark.parametrize("suffix", ["yml", "xml"])
@pytest.mark.parametrize("number", range(4))
def test_one_camera_of_opencv(tmp_path: Path, suffix: str, number: int) -> None:
    camera = replace(cameras()[number], rotation=np.eye(3), translation=np.zeros(3), row_s=0.0)
    fisheye = {"fisheye_model": 1} if camera.lens.model == "fisheye" else {}
    found = read_cameras(one_camera(tmp_path / f"camera.{suffix}", camera, **fisheye))
    assert_same(found.cameras, (camera,))


def stereo(folder: Path, pair: tuple[Camera, ...], unit: float) -> tuple[Path, Path]:
    inner = {
        f"{letter}{i}": value
        for i, one in enumerate(pair, start=1)
        for letter, value in (("M", one.matrix), ("D", np.array([one.lens.coefficients])))
    }
    first = stored(folder / "intrinsics.yml", **inner)
    move = pair[1].translation.reshape(3, 1) / unit
    return first, stored(folder / "extrinsics.yml", R=pair[1].rotation, T=move)


def test_a_stereo_pair_of_opencv(tmp_path: Path) -> None:
    pair = ring((0.0, 20.0))
    first, second = stereo(tmp_path, pair, 0.001)
    found = read_cameras(first, length_unit="mm", sizes_px=[SIZE], extrinsics=second)
    assert_same(found.cameras, pair)
    assert [one.name for one in found.cameras] == ["left", "right"]


def test_what_a_file_of_opencv_does_not_state_is_requested(tmp_path: Path) -> None:
    first, second = stereo(tmp_path, ring((0.0, 20.0)), 1.0)
    with pytest.raises(DatasetError, match="state width and height"):
        read_cameras(first, length_unit="m", extrinsics=second)
    with pytest.raises(DatasetError, match=r"give extrinsics\.yml too"):
        read_cameras(first, length_unit="m", sizes_px=[SIZE])
    with pytest.raises(DatasetError, match="state the unit of length"):
        read_cameras(first, sizes_px=[SIZE], extrinsics=second)
    path = one_camera(tmp_path / "camera.yml", cameras()[1])
    with pytest.raises(DatasetError, match="1024 x 800 px in the file, but 640 x 480 px are stated"):
        read_cameras(path, sizes_px=[(640, 480)])


OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 600., 0., 320., 0., 600., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0.1, 0., 0., 0., 0. ]
"""


def test_bad_files_of_opencv_are_refused(tmp_path: Path) -> None:
    camera = cameras()[1]
    skewed = camera.matrix.copy()
    skewed[0, 1] = 3.0
    with pytest.raises(DatasetError, match="skew 3"):
        read_cameras(one_camera(tmp_path / "skewed.yml", replace(camera, matrix=skewed)))
    size = {"image_width": 10, "image_height": 10}
    for count, value, message in ((7, 0.1, "7 coefficients"), (12, 0.1, "thin prism or tilted")):
        path = stored(
            tmp_path / f"{count}.yml",
            **size,
            camera_matrix=camera.matrix,
            distortion_coefficients=np.full((count, 1), value),
        )
        with pytest.raises(DatasetError, match=message):
            read_cameras(path)
    with pytest.raises(DatasetError, match="neither camera_matrix nor M1"):
        read_cameras(stored(tmp_path / "other.yml", **size, nothing=1))
    (tmp_path / "broken.yml").write_text("%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n  cols: [")
    with pytest.raises(DatasetError, match="OpenCV cannot read this file"):
        read_cameras(tmp_path / "broken.yml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rows: 3", "rows: 100000", "camera_matrix is no matrix: its rows, cols, dt and data do not belong together"),
        ("rows: 3", "rows: -3", "camera_matrix is no matrix"),
        ("rows: 5", "rows: 7", "distortion_coefficients is no matrix"),
        ("image_width: 640", "image_width: .Nan", r"no whole number from 1 to 100000; write the file again"),
        ("image_width: 640", 'image_width: "wide"', "no whole number from 1 to 100000"),
        ("image_width: 640", "image_width: 640.5", "no whole number from 1 to 100000"),
        ("image_width: 640", f"a: {'[' * 50_000}", "nested deeper than 32 levels"),
    ],
)  # fmt: skip
def test_numbers_that_do_not_belong_together_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """OpenCV raises its own errors for some of them, and ends the process for lists in lists."""
    assert OPENCV.count(old) == 1
    path = tmp_path / "camera.yml"
    path.write_text(OPENCV)
    assert read_cameras(path).cameras[0].size_px == (640, 480)
    path.write_text(OPENCV.replace(old, new))
    with pytest.raises(DatasetError, match=message):
        read_cameras(path)


def test_elements_in_elements_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "camera.xml"
    path.write_text(f"<?xml version='1.0'?>\n<opencv_storage>\n{'<a>' * 50_000}")
    with pytest.raises(DatasetError, match="nested deeper than 32 levels"):
        read_cameras(path)


@pytest.mark.skipif(not (DATA / "left_intrinsics.yml").is_file(), reason=f"no left_intrinsics.yml in {DATA}")
def test_files_that_come_with_opencv() -> None:
    """They have the header of older versions, which OpenCV 5 no longer writes."""
    (found,) = read_cameras(DATA / "left_intrinsics.yml").cameras
    assert found.size_px == (640, 480)
    assert found.matrix[0, 0] == pytest.approx(535.91573396163199)
    assert found.lens.coefficients[0] == pytest.approx(-0.26637260909660682)
    with pytest.raises(DatasetError, match=r"give extrinsics\.yml too"):
        read_cameras(DATA / "intrinsics.yml", sizes_px=[(640, 480)])


def anipose(cameras: tuple[Camera, ...], unit: float) -> str:
    lines = []
    for i, one in enumerate(cameras):
        lines += [
            f"[cam_{i}]",
            f'name = "{one.name}"',
            f"size = [ {one.size_px[0]}, {one.size_px[1]},]",
            f"matrix = {one.matrix.tolist()}",
            f"distortions = {list(one.lens.coefficients or [0.0] * 5)}",
            f"rotation = {Rotation.from_matrix(one.rotation).as_rotvec().tolist()}",
            f"translation = {(one.translation / unit).tolist()}",
            *(["fisheye = true"] if one.lens.model == "fisheye" else []),
            "",
        ]
    return "\n".join([*lines, "[metadata]", "adjusted = false", "error = 0.3", ""])


def test_anipose(tmp_path: Path) -> None:
    expected = tuple(replace(one, row_s=0.0) for one in cameras())
    path = tmp_path / "calibration.toml"
    path.write_text(anipose(expected, 0.001))
    found = read_cameras(path, length_unit="mm")
    assert_same(found.cameras, expected)
    assert [one.lens.model for one in found.cameras] == ["brown", "brown", "rational", "fisheye"]
    with pytest.raises(DatasetError, match="state the unit of the squares of the board"):
        read_cameras(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rotation =", "rotated =", r"cam_0.rotation: the key 'rotation' is missing"),
        ("size = [ 1024, 800,]", "size = [ 1024 ]", r"cam_0.size: list of 1 is no list of 2"),
        ("size = [ 1024, 800,]", 'size = [ 1024, "800" ]', "not all of these are finite numbers"),
        ("[cam_0]", "[cam_0", "not valid TOML"),
        ('name = "camera 0"', "name = 3", "3 is no text"),
        ('name = "camera 0"', 'name = "camera\\n0"', "is no name; give one line of at most 100 characters"),
        ('name = "camera 0"', f'name = "{"c" * 101}"', "is no name; give one line"),
        ('name = "camera 0"', 'name = "camera 0"\nfisheye = "yes"', "yes is neither true nor false"),
        ("size = [ 1024, 800,]", f"size = [ 1{'0' * 400}, 800,]", "not all of these are finite numbers"),
        ("[cam_0]", f"[cam_0]\na = {'[' * 5000}", "not valid TOML"),
        (
            "rotation = [",
            "rotation = [100.0, 0.0, 0.0] # [",
            "100 rad; at most 6.283: state the rotation vector in rad",
        ),
        ("[0.0, 0.0, 1.0]]", "[0.0, 0.5, 1.0]]", "no matrix of a camera"),
        ("distortions = [0.0, ", "distortions = [", ""),
    ],
)
def test_bad_files_of_anipose_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "calibration.toml"
    text = anipose(cameras(), 0.001)
    assert old in text
    path.write_text(text.replace(old, new, 1))
    if not message:
        # Four coefficients are those of OpenCV with k3 = 0.
        assert read_cameras(path, length_unit="mm").cameras[0].lens.coefficients == (0.0,) * 5
        return
    with pytest.raises(DatasetError, match=message):
        read_cameras(path, length_unit="mm")


@pytest.mark.parametrize("content", ["", "name: dataset\n", "hello world", "{}", "\x00\x01"])
def test_other_files_are_not_recognised(tmp_path: Path, content: str) -> None:
    path = tmp_path / "cameras.yaml"
    path.write_text(content)
    with pytest.raises(DatasetError, match="none of the known files of cameras"):
        read_cameras(path)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="cannot be read: No such file"):
        read_cameras(tmp_path / "cameras.yaml")
