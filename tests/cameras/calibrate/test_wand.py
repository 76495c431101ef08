"""Calibration from a wand: poses, scale and focal lengths come back within their errors; refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from tests.cameras.calibrate.simulated import parameter_errors, ring, wand_tracks
from wingfit.cameras.calibrate.result import Calibration
from wingfit.cameras.calibrate.wand import Wand, calibrate_wand, relative_pose, wand_poses
from wingfit.cameras.camera import Camera
from wingfit.cameras.triangulation import nearest_points, triangulate
from wingfit.records.errors import DatasetError

WANDS = (Wand((0.1,)), Wand((0.05, 0.07, 0.12)), Wand((0.06, 0.08, 0.1)))
FOCAL = ("f_x", "f_y")


def roughly(cameras: tuple[Camera, ...], scale: float = 1.0) -> list[Camera]:
    """The cameras without their poses, with focal lengths times ``scale``."""
    inner = np.array([[scale, 1, 1], [1, scale, 1], [1, 1, 1]])
    return [replace(c, matrix=c.matrix * inner, rotation=np.eye(3), translation=np.zeros(3)) for c in cameras]


def ratios(result: Calibration, true: tuple[Camera, ...]) -> tuple[np.ndarray, float]:
    free = np.array(result.free)
    errors, covariance = parameter_errors(result.cameras, true)[free], result.covariance[np.ix_(free, free)]
    return errors / np.sqrt(np.diag(covariance)), float(errors @ np.linalg.solve(covariance, errors))


@pytest.mark.parametrize("wand", WANDS, ids=["two markers", "three in line", "triangle"])
@pytest.mark.parametrize("free", [(), FOCAL], ids=["known lenses", "rough focal lengths"])
def test_cameras_are_recovered(wand: Wand, free: tuple[str, ...]) -> None:
    true, total, count = ring((0.0, 40.0, 80.0)), 0.0, 0
    for seed in range(2):
        tracks = wand_tracks(true, wand.shape, 75, np.random.default_rng(seed))
        result = calibrate_wand(tracks, roughly(true, 1.03 if free else 1.0), wand, free=free)
        parts, squares = ratios(result, true)
        assert np.abs(parts).max() < 4
        total, count = total + squares, count + len(parts)
    assert chi2.cdf(total, count) == pytest.approx(0.5, abs=0.4995)
    assert result.wand is not None
    assert len(result.wand.held_out_percent) == len(result.wand.used_percent) // 4
    assert 0 < result.wand.held_out_rms_percent < 0.4


def test_without_noise_lengths_and_cameras_are_exact() -> None:
    true = ring((0.0, 60.0))
    tracks = wand_tracks(true, WANDS[0].shape, 60, np.random.default_rng(1), noise=0.0)
    result = calibrate_wand(tracks, roughly(true), WANDS[0])
    assert np.abs(parameter_errors(result.cameras, true)).max() < 1e-7
    assert result.wand is not None
    assert result.wand.held_out_rms_percent < 1e-5


def test_a_chain_of_cameras_and_a_gap() -> None:
    true, wand = ring((0.0, 40.0, 80.0)), WANDS[0]
    tracks = wand_tracks(true, wand.shape, 240, np.random.default_rng(2))
    tracks["a"][120:], tracks["c"][:120] = np.nan, np.nan
    result = calibrate_wand(tracks, roughly(true), wand)
    assert np.abs(ratios(result, true)[0]).max() < 4
    tracks["b"][120:] = np.nan
    with pytest.raises(DatasetError, match="cameras c and the cameras a, b"):
        calibrate_wand(tracks, roughly(true), wand)


def test_swapped_points_are_rejected() -> None:
    true, wand = ring((0.0, 40.0, 80.0)), WANDS[0]
    tracks = wand_tracks(true, wand.shape, 120, np.random.default_rng(3))
    tracks["b"][17] = tracks["b"][17, ::-1]
    result = calibrate_wand(tracks, roughly(true), wand)
    assert {(one.camera, one.image) for one in result.rejected} >= {("b", "17")}
    assert np.abs(ratios(result, true)[0]).max() < 4


def test_the_shape_has_the_distances() -> None:
    for wand in WANDS:
        found = [np.linalg.norm(wand.shape[a] - wand.shape[b]) for a, b in wand.pairs]
        np.testing.assert_allclose(found, wand.distances_m, rtol=1e-12)
    assert [wand.straight for wand in WANDS] == [True, True, False]


def test_points_are_triangulated_where_two_cameras_see_them() -> None:
    true = ring((0.0, 40.0, 80.0))
    points = np.array([[0.01, 0.02, 0.6], [-0.05, 0.03, 0.55], [0, 0, 0.62]])
    pixels = np.stack([camera.project(points) for camera in true])
    pixels[0, 1] = np.nan
    pixels[:2, 2] = np.nan
    for found in (nearest_points(true, pixels), triangulate(true, pixels, np.tile(np.eye(2), (3, 3, 1, 1))).positions):
        np.testing.assert_allclose(found[:2], points[:2], atol=1e-9)
        assert np.isnan(found[2]).all()


def test_points_behind_a_camera_are_none() -> None:
    """Rays that part meet behind the cameras."""
    true = ring((0.0, 40.0))
    pixels = np.stack([camera.project(np.array([[0.0, 0.0, 0.6]])) for camera in true])
    pixels[0, 0, 0] -= 450
    pixels[1, 0, 0] += 450
    assert np.isnan(nearest_points(true, pixels)).all()
    assert np.isnan(triangulate(true, pixels, np.tile(np.eye(2), (2, 1, 1, 1))).positions).all()


@pytest.mark.parametrize("wand", WANDS, ids=["two markers", "three in line", "triangle"])
def test_the_length_of_the_wand_gives_the_scale_of_a_pair(wand: Wand) -> None:
    true = ring((0.0, 40.0))
    tracks = wand_tracks(true, wand.shape, 40, np.random.default_rng(5), noise=0.0)
    first, second = roughly(true)
    link = relative_pose((first, second), np.stack([tracks["a"], tracks["b"]]), wand)
    assert link is not None
    np.testing.assert_allclose(link.pose.rotation, true[1].rotation, atol=1e-6)
    np.testing.assert_allclose(link.pose.translation, true[1].translation, atol=1e-6)


@pytest.mark.parametrize("wand", WANDS, ids=["two markers", "three in line", "triangle"])
def test_poses_bring_the_wand_to_its_markers(wand: Wand) -> None:
    rng = np.random.default_rng(6)
    turns, moves = Rotation.random(20, rng=rng).as_matrix(), rng.standard_normal((20, 3))
    points = np.einsum("fij,mj->fmi", turns, wand.shape) + moves[:, None]
    found = wand_poses(points, wand)
    again = np.einsum("fij,mj->fmi", found.rotation, wand.shape) + found.translation[:, None]
    np.testing.assert_allclose(again, points, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(found.rotation), 1.0)


def test_refusals() -> None:
    true, wand = ring((0.0, 40.0)), WANDS[0]
    tracks = wand_tracks(true, wand.shape, 60, np.random.default_rng(4))
    cameras = roughly(true)
    with pytest.raises(DatasetError, match="either a camera or its tracks are missing: b"):
        calibrate_wand({"a": tracks["a"]}, cameras, wand)
    with pytest.raises(DatasetError, match=r"different numbers of frames \(a: 60, b: 50\)"):
        calibrate_wand({**tracks, "b": tracks["b"][:50]}, cameras, wand)
    with pytest.raises(DatasetError, match="frames x 3 markers"):
        calibrate_wand(tracks, cameras, WANDS[1])
    with pytest.raises(DatasetError, match="a pixel is infinite"):
        calibrate_wand({**tracks, "b": np.where(np.arange(60)[:, None, None] == 3, np.inf, tracks["b"])}, cameras, wand)
    with pytest.raises(DatasetError, match="far outside the image of 1024 x 800 px"):
        calibrate_wand({**tracks, "b": tracks["b"] * 10}, cameras, wand)
    with pytest.raises(DatasetError, match="15 frames with every marker in two cameras; at least 20"):
        calibrate_wand({name: one[:15] for name, one in tracks.items()}, cameras, wand)
    with pytest.raises(DatasetError, match="has no parameter 'focal'"):
        calibrate_wand(tracks, cameras, wand, free=("focal",))
    with pytest.raises(DatasetError, match="1 different cameras; from 2 to 8"):
        calibrate_wand({"a": tracks["a"]}, cameras[:1], wand)


@pytest.mark.parametrize(
    ("distances", "message"),
    [
        ((100.0,), r"100.0 m; it must lie in \(0, 10\] m: give metres, 120 mm is 0.12"),
        ((0.1, 0.1), "2 distances; give 1 for two markers, or 3"),
        ((0.1, 0.1, 0.3), "0.3 m is more than the sum of the two other distances"),
        ((float("nan"),), "must lie in"),
    ],
)
def test_a_wand_that_cannot_be_is_refused(distances: tuple[float, ...], message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        Wand(distances)
