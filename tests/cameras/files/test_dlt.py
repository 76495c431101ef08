"""DLT coefficients: cameras come back whatever corner pixels are counted from; skew and aspect are checked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cameras.files.samples import POINTS, assert_same, pinholes
from wingfit.cameras.camera import Camera
from wingfit.cameras.files.dlt import DltOrigin, camera_of_matrix, without_skew
from wingfit.cameras.files.read import read_cameras
from wingfit.records.errors import DatasetError

SIZES = [(1024, 800)]


def in_front(cameras: tuple[Camera, ...]) -> tuple[Camera, ...]:
    """The cameras in a space of which the origin lies 0.6 m before the first one."""
    middle = np.array([0, 0, 0.6])
    return tuple(replace(one, translation=one.rotation @ middle + one.translation) for one in cameras)


def coefficients(camera: Camera, origin: DltOrigin, unit: float) -> np.ndarray:
    """The least-squares coefficients of the pixels of many points, as a calibration program estimates them."""
    points = (POINTS - np.array([0, 0, 0.6])) / unit
    pixels = camera.project(points * unit)
    if origin == "lower-left":
        pixels = np.column_stack([pixels[:, 0] + 1, camera.size_px[1] - pixels[:, 1]])
    elif origin == "upper-left":
        pixels = pixels + 1
    ones, zeros = np.ones((len(points), 1)), np.zeros((len(points), 4))
    rows = [
        np.hstack([points, ones, zeros, -pixels[:, :1] * points]),
        np.hstack([zeros, points, ones, -pixels[:, 1:] * points]),
    ]
    return np.asarray(np.linalg.lstsq(np.concatenate(rows), pixels.T.ravel(), rcond=None)[0])


def saved(path: Path, cameras: tuple[Camera, ...], origin: DltOrigin, unit: float = 1.0) -> Path:
    table = np.column_stack([coefficients(one, origin, unit) for one in cameras])
    np.savetxt(path, table, delimiter=",", fmt="%.15g")
    return path


@pytest.mark.parametrize("origin", ["lower-left", "upper-left", "opencv"])
def test_cameras_come_back(tmp_path: Path, origin: DltOrigin) -> None:
    true = in_front(pinholes())
    path = saved(tmp_path / "dltCoefs.csv", true, origin, 0.001)
    found = read_cameras(path, length_unit="mm", sizes_px=SIZES, dlt_origin=origin)
    moved = POINTS - np.array([0, 0, 0.6])
    for one, other in zip(found.cameras, true, strict=True):
        np.testing.assert_allclose(one.project(moved), other.project(moved), atol=1e-5)
        np.testing.assert_allclose(one.centre, other.centre, atol=1e-7)
        np.testing.assert_allclose(one.matrix, other.matrix, rtol=1e-6, atol=1e-3)
    assert "distortion is not in this format" in found.notes[-1]
    assert f"counted as {origin}" in found.notes[-1]


def test_the_other_origin_is_noticed(tmp_path: Path) -> None:
    """A mirrored image puts the origin behind all cameras, because the axes of a camera are right-handed."""
    path = saved(tmp_path / "dltCoefs.csv", in_front(pinholes()), "lower-left")
    with pytest.raises(DatasetError, match="lies behind all cameras if pixels are counted from upper-left"):
        read_cameras(path, length_unit="m", sizes_px=SIZES, dlt_origin="upper-left")


def test_one_camera_may_look_away_from_the_origin(tmp_path: Path) -> None:
    """The scale of the coefficients, that of the depth of the origin, is then negative."""
    first, second, _ = in_front(pinholes())
    away = np.diag([1.0, -1.0, -1.0])
    second = replace(second, rotation=away @ second.rotation, translation=away @ second.translation)
    decomposed = camera_of_matrix("table", "b", np.append(exact(second), 1.0).reshape(3, 4), SIZES[0])
    np.testing.assert_allclose(decomposed.translation, second.translation, atol=1e-9)
    np.testing.assert_allclose(decomposed.rotation, second.rotation, atol=1e-9)
    table = np.column_stack([coefficients(first, "opencv", 1.0), exact(second)])
    np.savetxt(tmp_path / "dltCoefs.csv", table, delimiter=",", fmt="%.15g")
    found = read_cameras(tmp_path / "dltCoefs.csv", length_unit="m", sizes_px=SIZES, dlt_origin="opencv")
    np.testing.assert_allclose(found.cameras[1].rotation, second.rotation, atol=1e-7)
    np.testing.assert_allclose(found.cameras[1].translation, second.translation, atol=1e-7)


def exact(camera: Camera) -> np.ndarray:
    """The coefficients that the matrices of a camera give."""
    matrix = camera.matrix @ np.column_stack([camera.rotation, camera.translation])
    return np.asarray(matrix.ravel()[:11] / matrix[2, 3])


def test_the_camera_without_skew_is_the_nearest() -> None:
    """Dropping the skew alone differs more from the coefficients than the camera that is fitted to them."""
    camera = in_front(pinholes())[1]
    skewed = exact(camera)
    skewed[:4] += 0.02 * skewed[4:8]
    matrix = np.append(skewed, 1.0).reshape(3, 4)
    dropped = camera_of_matrix("table", "b", matrix, SIZES[0])
    fitted, rms = without_skew(dropped, matrix)
    # A turn by half the skew s makes errors s y in x into s y / 2 in x and s x / 2 in y, smaller in RMS for this image
    # by 0.5 (1 + (1024 / 800)^2)^0.5 = 0.81; the other parameters take a little more.
    points = 4 * (POINTS - np.array([0, 0, 0.6]))
    ends = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    off = [np.linalg.norm(one.project(points) - ends[:, :2] / ends[:, 2:], axis=1).mean() for one in (dropped, fitted)]
    assert off[1] < 0.82 * off[0]
    assert 0 < rms < 5
    with pytest.raises(DatasetError, match="singular"):
        camera_of_matrix("table", "b", np.ones((3, 4)), SIZES[0])


def test_skew_is_reported_and_limited(tmp_path: Path) -> None:
    true = in_front(pinholes())
    table = np.column_stack([coefficients(one, "opencv", 1.0) for one in true])

    def with_skew(amount: float) -> Path:
        changed = table.copy()
        changed[:4, 0] += amount * changed[4:8, 0]
        np.savetxt(tmp_path / "skewed.csv", changed, delimiter=",")
        return tmp_path / "skewed.csv"

    found = read_cameras(with_skew(0.01), length_unit="m", sizes_px=SIZES, dlt_origin="opencv")
    rms = [float(note.split(" differs by ")[1].split(" px")[0]) for note in found.notes[:3]]
    assert 0.5 < rms[0] < 5
    assert max(rms[1:]) < 1e-3
    with pytest.raises(DatasetError, match=r"camera 1: skew 0.1 of the focal length; at most 0.05"):
        read_cameras(with_skew(0.1), length_unit="m", sizes_px=SIZES, dlt_origin="opencv")
    table[:4, 1] *= 1.3
    np.savetxt(tmp_path / "stretched.csv", table, delimiter=",")
    with pytest.raises(DatasetError, match=r"camera 2: focal lengths .* their ratio must lie in \[0.91, 1.1\]"):
        read_cameras(tmp_path / "stretched.csv", length_unit="m", sizes_px=SIZES, dlt_origin="opencv")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: rows[:10], "10 rows; 11 rows with one number for each camera"),
        (lambda rows: [*rows[:3], "1,2,x", *rows[4:]], "line 4, column 3: 'x' is no finite number; give L4"),
        (lambda rows: [*rows[:3], "1,2,nan", *rows[4:]], "line 4, column 3: 'nan' is no finite number"),
        (lambda rows: ["0,0,0" for _ in rows], "not those of a camera"),
    ],
)
def test_bad_tables_are_refused(tmp_path: Path, change: object, message: str) -> None:
    path = saved(tmp_path / "dltCoefs.csv", in_front(pinholes()), "opencv")
    assert callable(change)
    path.write_text("\n".join(change(path.read_text().splitlines())))
    with pytest.raises(DatasetError, match=message):
        read_cameras(path, length_unit="m", sizes_px=SIZES, dlt_origin="opencv")


def test_all_that_the_file_does_not_state_is_requested_at_once(tmp_path: Path) -> None:
    path = saved(tmp_path / "dltCoefs.csv", in_front(pinholes()), "opencv")
    with pytest.raises(
        DatasetError, match=r"unit of length .*, nor the size of the images .*, nor the origin of pixels"
    ):
        read_cameras(path)
    with pytest.raises(DatasetError, match="2 sizes of images for 3 cameras"):
        read_cameras(path, length_unit="m", sizes_px=SIZES * 2, dlt_origin="opencv")


def test_a_camera_with_equal_sizes_is_the_same_as_one_size_for_all(tmp_path: Path) -> None:
    true = in_front(pinholes())
    path = saved(tmp_path / "dltCoefs.csv", true, "opencv")
    one = read_cameras(path, length_unit="m", sizes_px=SIZES, dlt_origin="opencv")
    three = read_cameras(path, length_unit="m", sizes_px=SIZES * 3, dlt_origin="opencv")
    assert_same(one.cameras, three.cameras)
