"""Cameras in ``dataset.yaml``: what is read, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.records.malformed import error_of_zip, good_files, zipped
from tests.records.samples import falcon_cameras, falcon_dataset
from wingfit.records import CameraPose, Dataset, DatasetError, load_dataset, save_dataset, wing_or_vehicle


def with_cameras(*cameras: CameraPose) -> Dataset:
    return replace(falcon_dataset(12), cameras=cameras)


@pytest.mark.parametrize("name", ["folder", "one.zip", "one.nc"])
def test_cameras_return_exactly(tmp_path: Path, name: str) -> None:
    save_dataset(falcon_dataset(12), tmp_path / name)
    assert wing_or_vehicle(load_dataset(tmp_path / name)).cameras == falcon_cameras()


def test_cameras_may_be_left_out(tmp_path: Path) -> None:
    save_dataset(with_cameras(), tmp_path / "plain")
    assert "cameras" not in (tmp_path / "plain" / "dataset.yaml").read_text()
    assert wing_or_vehicle(load_dataset(tmp_path / "plain")).cameras == ()


LEFT, RIGHT = falcon_cameras()
AXES = np.array(LEFT.rotation)


def turned(axes: np.ndarray) -> CameraPose:
    return CameraPose.of("right", np.array(RIGHT.centre), axes, RIGHT.focal_px)


@pytest.mark.parametrize(
    ("cameras", "said"),
    [
        ((LEFT,), ["one camera", "add the others"]),
        (tuple(replace(LEFT, name=f"c{k}") for k in range(9)), ["more than 8 entries"]),
        ((LEFT, replace(RIGHT, name="left")), ["'left' is used a second time"]),
        ((LEFT, turned(0.999 * AXES)), ["[1].rotation", "1", "right angles", "seven digits"]),
        ((LEFT, turned(AXES * [[1.0], [1.0], [0.9999]])), ["[1].rotation", "right angles"]),
        ((LEFT, turned(AXES * [[-1], [1], [1]])), ["mirrored against that of 'left'"]),
        ((LEFT, turned(AXES * [[1], [-1], [-1]])), ["m behind it", "right, down, forward"]),
        ((LEFT, replace(RIGHT, centre=(0.03, 0.25, 0.0))), ["cannot see marker", "0.01 m", "centre_m"]),
        ((LEFT, replace(RIGHT, centre=(0.1, float("nan"), 1.4))), ["centre_m", "finite number"]),
        ((LEFT, replace(RIGHT, focal_px=float("inf"))), ["focal_px", "finite number"]),
        ((LEFT, replace(LEFT, name="copy")), ["[1].centre_m", "'copy' is 0 m from 'left'", "remove one"]),
        ((LEFT, replace(RIGHT, focal_px=0.0)), ["focal_px", "px"]),
        ((LEFT, replace(RIGHT, centre=(0.1, 0.6, 1400.0))), ["centre_m", "1400", "[-1000, 1000] m", "metres"]),
    ],
)
def test_what_is_refused(tmp_path: Path, cameras: tuple[CameraPose, ...], said: list[str]) -> None:
    with pytest.raises(DatasetError) as error:
        save_dataset(with_cameras(*cameras), tmp_path / "bad")
    for words in said:
        assert words in str(error.value)


def test_an_error_in_the_file_names_its_line() -> None:
    text = good_files()["dataset.yaml"].decode()
    files = {**good_files(), "dataset.yaml": text.replace("name: right", "name: left").encode()}
    error = error_of_zip(zipped(files))
    assert "'left' is used a second time here" in str(error)
    assert "cameras[1].name" in str(error)


def test_a_camera_sees_the_same_from_another_frame() -> None:
    rng = np.random.default_rng(2)
    turn, origin = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3)
    points = rng.normal(size=(5, 3))
    moved = (points - origin) @ turn.T
    for camera in falcon_cameras():
        other = camera.seen_from(turn, origin)
        own = (points - camera.centre) @ np.array(camera.rotation).T
        np.testing.assert_allclose((moved - other.centre) @ np.array(other.rotation).T, own, atol=1e-14)
        np.testing.assert_allclose(other.depth(moved), camera.depth(points), atol=1e-14)
