"""Points in space from pixels: closed forms, and covariances against many draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from tests.cameras.calibrate.simulated import ring
from tests.cameras.test_camera import changed
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.triangulation import error_from_cameras, triangulate
from wingfit.records.array_types import Array

FOCAL, BASE, DEPTH = 1000.0, 0.2, 1.5
EYE = np.eye(2)


def stereo() -> tuple[Camera, Camera]:
    """Two pinhole cameras side by side that look along z, with BASE metres between them."""
    matrix = np.array([[FOCAL, 0, 500], [0, FOCAL, 400], [0, 0, 1.0]])
    left = Camera("left", (1000, 800), matrix, Lens(), np.eye(3), np.zeros(3))
    return left, replace(left, name="right", translation=np.array([-BASE, 0, 0]))


def seen(cameras: tuple[Camera, ...], points: Array) -> Array:
    return np.stack([camera.project(points) for camera in cameras])


def variances(cameras: int, points: int, variance: float = 1.0) -> Array:
    return np.tile(variance * EYE, (cameras, points, 1, 1))


def test_stereo_has_the_closed_form() -> None:
    """Depth is focal length times base over disparity; its deviation is depth^2 sqrt(2) over focal length and base."""
    cameras, point = stereo(), np.array([[BASE / 2, 0.0, DEPTH]])
    sigma = 0.1
    found = triangulate(cameras, seen(cameras, point), variances(2, 1, sigma**2))
    assert found.positions == pytest.approx(point, abs=1e-9)
    assert found.misfit == pytest.approx([0], abs=1e-12)
    assert list(found.freedom) == [1]
    deviation = np.sqrt(np.diag(found.covariance[0]))
    depth = DEPTH**2 * np.sqrt(2) * sigma / FOCAL / BASE
    assert deviation[2] == pytest.approx(depth, rel=1e-6)
    across = DEPTH / FOCAL * sigma / np.sqrt(2)
    assert deviation[:2] == pytest.approx([across, across], rel=1e-6)
    disparity = np.array([[[566.0, 400.0]], [[434.0, 400.0]]])
    assert triangulate(cameras, disparity, variances(2, 1)).positions[0, 2] == pytest.approx(FOCAL * BASE / 132)


def test_rays_that_miss_each_other_have_the_closed_misfit() -> None:
    """Pixels d apart in y, with variances a and b, leave d^2 / (a + b); the point is nearer to the surer camera."""
    cameras, point = stereo(), np.array([[BASE / 2, 0.0, DEPTH]])
    pixels, spread = seen(cameras, point), variances(2, 1)
    pixels[0, :, 1] += 1.0
    spread[0], spread[1] = 0.5 * EYE, 1.5 * EYE
    found = triangulate(cameras, pixels, spread)
    assert found.misfit == pytest.approx([0.5], rel=1e-4)
    assert cameras[0].project(found.positions)[0, 1] == pytest.approx(400.75, abs=1e-3)


@pytest.mark.parametrize("model", ["brown", "fisheye"])
def test_covariance_and_misfit_are_those_of_300_draws(model: str) -> None:
    cameras = ring((-30.0, 5.0, 40.0), "brown" if model == "brown" else "fisheye")
    rng = np.random.default_rng(3)
    draws, point = 300, np.array([[0.03, -0.04, 0.62]])
    factors = np.array([[[0.5, 0.0], [0.2, 0.3]], [[0.3, 0.0], [-0.1, 0.6]], [[1.0, 0.0], [0.0, 0.2]]])
    pixels = seen(cameras, np.repeat(point, draws, axis=0))
    pixels = pixels + np.einsum("cij,cnj->cni", factors, rng.standard_normal((3, draws, 2)))
    spread = np.repeat((factors @ np.swapaxes(factors, 1, 2))[:, None], draws, axis=1)
    found = triangulate(cameras, pixels, spread)
    errors = found.positions - point
    distance = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(found.covariance), errors)
    assert kstest(distance, chi2(3).cdf).pvalue > 0.01
    assert kstest(found.misfit, chi2(3).cdf).pvalue > 0.01
    assert set(found.freedom) == {3}
    assert np.cov(errors.T) == pytest.approx(found.covariance.mean(0), abs=0.2 * found.covariance.mean(0).max())


def test_a_camera_that_does_not_see_a_point_has_no_part_in_it() -> None:
    cameras = ring((-30.0, 5.0, 40.0))
    points = np.array([[0.02, 0.01, 0.6], [-0.03, 0.02, 0.58], [0.0, 0.0, 0.6]])
    pixels = seen(cameras, points)
    pixels[2, 0] = np.nan
    pixels[1:, 1] = np.nan
    found = triangulate(cameras, pixels, variances(3, 3))
    assert found.positions[[0, 2]] == pytest.approx(points[[0, 2]], abs=1e-9)
    assert np.isnan(found.positions[1]).all()
    assert np.isnan(found.covariance[1]).all()
    assert list(found.freedom) == [1, -1, 3]
    alone = triangulate(cameras[:2], pixels[:2, :1], variances(2, 1))
    assert found.covariance[0] == pytest.approx(alone.covariance[0])


def test_nothing_seen_is_nothing_found() -> None:
    cameras = stereo()
    found = triangulate(cameras, np.empty((2, 0, 2)), np.empty((2, 0, 2, 2)))
    assert found.positions.shape == (0, 3)
    assert np.isnan(triangulate(cameras, np.full((2, 2, 2), np.nan), variances(2, 2)).positions).all()


def test_parallel_rays_have_no_point() -> None:
    pixels = np.array([[[500.0, 400.0]], [[500.0, 400.0]]])
    found = triangulate(stereo(), pixels, variances(2, 1))
    assert np.isnan(found.positions).all()


def test_error_from_cameras_is_that_of_finite_differences() -> None:
    cameras = ring((-30.0, 25.0))
    rng = np.random.default_rng(4)
    points = rng.uniform(-0.05, 0.05, (4, 3)) + np.array([0, 0, 0.6])
    pixels, spread = seen(cameras, points), variances(2, 4)
    spread[1] *= 3.0
    pixels[1, 3] = np.nan
    found = triangulate(cameras, pixels, spread)
    total = sum(len(camera.parameter_names) for camera in cameras)
    changes = error_from_cameras(cameras, found, pixels, spread, np.eye(total))
    assert changes.shape == (4, 3, total)
    column = 0
    for number, camera in enumerate(cameras):
        sizes = np.abs(camera.project_with_changes(points)[2]).max((0, 1))
        for name, size in zip(camera.parameter_names, sizes, strict=True):
            step = 0.02 / size  # moves a pixel by 0.02
            moved = []
            for sign in (1, -1):
                other = list(cameras)
                other[number] = changed(camera, name, sign * step)
                moved.append(triangulate(other, pixels[:, :3], spread[:, :3]).positions)
            expected = (moved[0] - moved[1]) / (2 * step)
            scale = np.abs(expected).max() + 1e-9
            assert changes[:3, :, column] / scale == pytest.approx(expected / scale, abs=2e-3), (camera.name, name)
            column += 1
