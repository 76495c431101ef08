"""Faults in the images of cameras that a dataset states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.records.samples import falcon_cameras
from tests.sim.effects.rigs import Array, rigid_tracks, seen, wing_model
from wingfit.records import CameraPose
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.ports.stated_cameras import image, triangulated
from wingfit.sim.effects.ports.stereo import Stereo
from wingfit.sim.effects.registry import EFFECTS

AIM = np.array([0.03, 0.25, 0.0])  # where the axes of falcon_cameras() meet
DOWN = np.diag([1.0, 1.0, -1.0])  # right along x, down in the image along y, as the assumed pair
X, Y, HIGH, BASE = 0.1, 0.25, 1.4, 0.6


def parallel() -> tuple[CameraPose, ...]:
    places = (("inner", Y - BASE / 2), ("outer", Y + BASE / 2))
    return tuple(CameraPose.of(name, np.array([X, y, HIGH]), DOWN, 1500.0) for name, y in places)


def filmed(points: Array, cameras: tuple[CameraPose, ...]) -> Sampling:
    """A beat of ``points`` [n, M, 3] before ``cameras``."""
    return replace(rigid_tracks(), beat=points[None].copy(), cameras=cameras)


def cloud() -> Array:
    return np.asarray(AIM + np.random.default_rng(3).uniform(-0.2, 0.2, (6, 5, 3)))


def least_pixels(cameras: Sequence[CameraPose], images: Sequence[tuple[Array, ...]], near: Array) -> Array:
    """The point [3] with the least sum of squared errors in pixels, by scipy."""

    def errors(p: Array) -> Array:
        pairs = zip(cameras, images, strict=True)
        return np.concatenate([camera.focal_px * np.subtract(image(camera, p), shown) for camera, shown in pairs])

    return np.asarray(least_squares(errors, near, xtol=1e-15, ftol=1e-15, gtol=1e-15).x)


def test_undistorted_images_give_the_points_back() -> None:
    points, cameras = cloud(), falcon_cameras()
    images = [image(camera, points) for camera in cameras]
    np.testing.assert_allclose(triangulated(cameras, images, points + 0.05), points, atol=1e-13)


def test_a_point_on_the_axes_is_not_moved() -> None:
    before = filmed(np.broadcast_to(AIM, (4, 2, 3)), falcon_cameras())
    after = seen("lens_distortion", before, k1=-0.25, k2=0.1)
    np.testing.assert_allclose(after.beat[0], before.beat[0], atol=1e-15)


def test_a_barrel_moves_points_inwards_and_a_pincushion_outwards() -> None:
    flat = AIM + np.array([[[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [-0.15, -0.15, 0.0]]])
    away = {k: np.linalg.norm(seen("lens_distortion", filmed(flat, falcon_cameras()), k1=k).beat[0] - AIM, axis=-1)
            for k in (-0.2, 0.2)}  # fmt: skip
    still = np.linalg.norm(flat - AIM, axis=-1)
    assert np.all(away[-0.2] < still - 1e-4)
    assert np.all(away[0.2] > still + 1e-4)


def test_the_point_is_that_of_the_distorted_images() -> None:
    """The law by hand for one marker, and the point of these images by scipy."""
    cameras, point = falcon_cameras(), AIM + np.array([0.12, 0.2, 0.05])
    images = []
    for camera in cameras:
        right, down, forward = np.array(camera.rotation) @ (point - camera.centre)
        u, v = right / forward, down / forward
        r2 = u * u + v * v
        radial, p1 = 1 - 0.2 * r2 + 0.1 * r2 * r2, 0.002
        images.append((u * radial + 2 * p1 * u * v, v * radial + p1 * (r2 + 2 * v * v)))
    found = seen("lens_distortion", filmed(point[None, None], cameras), k1=-0.2, k2=0.1, p1=0.002).beat
    assert np.linalg.norm(found - point) > 5e-4
    np.testing.assert_allclose(found[0, 0, 0], least_pixels(cameras, images, point), atol=1e-9)


def test_rays_that_do_not_meet_end_at_the_least_sum_of_squared_pixels() -> None:
    """Three cameras of different focal lengths, against scipy; the weights are those of pixels."""
    third = replace(falcon_cameras()[0], name="third", centre=(-0.4, 0.1, 1.2), focal_px=800.0)
    cameras, point, rng = (*falcon_cameras(), third), AIM + 0.05, np.random.default_rng(5)
    images = [tuple(np.asarray(one + rng.normal(0, 0.005)) for one in image(camera, point)) for camera in cameras]

    best = least_pixels(cameras, images, point)
    found = triangulated(cameras, images, point)  # type: ignore[arg-type]
    assert np.linalg.norm(best - point) > 1e-3
    np.testing.assert_allclose(found, best, atol=1e-9)


def test_two_parallel_cameras_are_the_assumed_pair() -> None:
    """Also where rays do not meet. The pair counts v from the point aimed at, half the base from its axis."""
    pair = Stereo(*(np.full((1, 1, 1), value) for value in (X, Y, HIGH, BASE)))
    rng, points = np.random.default_rng(1), rigid_tracks().beat
    images = [
        tuple(part + rng.normal(0, 0.01, part.shape) for part in pair.image(points, side)) for side in (-1.0, 1.0)
    ]
    wanted = pair.points(*images)  # type: ignore[arg-type]
    offset = 0.5 * BASE / HIGH
    own = [(u, v - side * offset) for side, (u, v) in zip((-1.0, 1.0), images, strict=True)]
    assert np.abs(wanted - points).max() > 0.02
    np.testing.assert_allclose(triangulated(parallel(), own, points), wanted, atol=1e-12)


def test_the_last_camera_is_late_as_the_outer_one_of_the_assumed_pair() -> None:
    before = rigid_tracks()
    assumed = seen("camera_desync", before, delay=0.003, x=X, y=Y, distance=HIGH, base=BASE / HIGH)
    stated = seen("camera_desync", replace(before, cameras=parallel()), delay=0.003)
    assert np.abs(assumed.beat - before.beat).max() > 1e-3
    np.testing.assert_allclose(stated.beat, assumed.beat, atol=1e-12)


@pytest.mark.parametrize("name", ["lens_distortion", "camera_desync"])
def test_stated_cameras_have_no_places_to_fit(name: str) -> None:
    model = wing_model()
    places = {f"{name}.{place}" for place in ("x", "y", "distance", "base")}
    sizes = {f"{name}.{p.name}" for p in EFFECTS[name].size}
    stated = replace(model, cameras=falcon_cameras()).with_effects(name)
    assert {gene.name for gene in model.with_effects(name).genes[len(model.genes) :]} == sizes | places
    assert {gene.name for gene in stated.genes[len(model.genes) :]} == sizes
    assert set(EFFECTS[name].typical(model.wing, stated.cameras)) == sizes


def test_a_mirrored_wing_is_moved_by_the_mirror_image() -> None:
    mirror, points = np.diag([1.0, -1.0, 1.0]), cloud()
    cameras = tuple(camera.seen_from(mirror, np.zeros(3)) for camera in falcon_cameras())
    own = seen("lens_distortion", filmed(points, falcon_cameras()), k1=-0.2, p1=0.01).beat
    other = seen("lens_distortion", filmed(points @ mirror, cameras), k1=-0.2, p1=0.01).beat
    np.testing.assert_allclose(other, own @ mirror, atol=1e-14)


def test_an_individual_does_not_depend_on_its_batch() -> None:
    points, cameras = np.stack([cloud(), cloud() + 0.01, cloud() - 0.01]), falcon_cameras()
    images = [(0.98 * u, 0.98 * v) for u, v in (image(camera, points) for camera in cameras)]
    whole = triangulated(cameras, images, points)
    alone = triangulated(cameras, [(u[1:2], v[1:2]) for u, v in images], points[1:2])
    assert np.array_equal(whole[1:2], alone)
