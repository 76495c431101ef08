"""Detections between frames, clocks of cameras, and rays that meet."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cameras.calibrate.simulated import ring
from wingfit.cameras.camera import Camera
from wingfit.cameras.markers.detections import Detections, no_detections
from wingfit.cameras.track.cloud import possible_points
from wingfit.cameras.track.synchronise import common_times, offset_between
from wingfit.cameras.track.tracklets import Tracklets, at_time, join
from wingfit.records.array_types import Array

RATE, BEAT, SIGMA = 240.0, 3.0, 0.05
DOTS = 40.0 * np.column_stack([np.arange(12) % 4, np.arange(12) // 4])


def detections(pixels: Array, sigma: float = SIGMA) -> Detections:
    count = len(pixels)
    return Detections(
        pixels,
        np.tile(sigma**2 * np.eye(2), (count, 1, 1)),
        np.full(count, 5.0),
        np.full(count, 100.0),
        np.full((count, 2), np.nan),
    )


def track(time: Array | float) -> Array:
    """Pixels [..., 12, 2] of dots that move as sines of their own phases."""
    phase = 2 * np.pi * BEAT * np.asarray(time)[..., None] + 0.1 * np.arange(12)
    return np.asarray(150 + DOTS + 40 * np.stack([np.cos(phase), np.sin(phase)], axis=-1))


def filmed(row_s: float, frames: int = 60) -> tuple[list[Detections], Array]:
    """What a camera with a rolling shutter sees: each dot when its row is read."""
    times, rng, seen = np.arange(frames) / RATE, np.random.default_rng(6), []
    for time in times:
        at = np.full(12, time)
        for _ in range(30):
            each: Array = np.diagonal(track(at), axis1=0, axis2=1).T
            at = time + row_s * each[:, 1]
        seen.append(detections(each[rng.permutation(12)]))
    return seen, times


def order(pixels: Array, near: Array) -> Array:
    return np.asarray(np.linalg.norm(near[:, None] - pixels[None], axis=2).argmin(1))


@pytest.mark.parametrize("row_s", [0.0, 1e-5])
def test_a_sinusoidal_track_is_read_between_frames(row_s: float) -> None:
    seen, times = filmed(row_s)
    joined = join(seen, times, row_s)
    assert len(np.unique(joined.owner)) == 12
    for time in np.linspace(times[3], times[-4], 50):
        found, true = at_time(joined, time, 1.5 / RATE), track(time)
        assert len(found) == 12
        errors = found.pixels[order(found.pixels, true)] - true
        # The error of a cubic through four samples h apart is at most 9/384 of h^4 times the fourth derivative.
        assert np.abs(errors).max() < 1.2 * 9 / 384 * 40 * (2 * np.pi * BEAT / RATE) ** 4
        assert (np.trace(found.covariance, axis1=1, axis2=2) < 2.2 * SIGMA**2 * 2).all()


def test_dots_are_read_at_their_own_times() -> None:
    """At the time of a frame they are those of the frame: also of the last one, and before a gap."""
    seen, times = filmed(0.0)
    missing = order(seen[20].pixels, track(times[20])[:1])[0]
    seen[20] = seen[20].only(np.arange(12) != missing)
    joined = join(seen, times, 0.0)
    for number in (0, 1, 10, 18, 19, 21, 22, 59):
        found = at_time(joined, times[number], 1.5 / RATE)
        assert len(found) == 12, number
        assert found.pixels[order(found.pixels, track(times[number]))] == pytest.approx(track(times[number]), abs=1e-6)
    assert len(at_time(joined, times[20], 1.5 / RATE)) == 11
    assert len(at_time(joined, times[19] + 0.3 / RATE, 1.5 / RATE)) == 11
    assert len(at_time(joined, times[-1] + 1e-3, 1.5 / RATE)) == 0


def test_frames_without_detections_break_tracks() -> None:
    seen, times = filmed(0.0, 30)
    seen[14] = no_detections()
    joined = join(seen, times, 0.0)
    assert len(np.unique(joined.owner)) == 24
    assert len(at_time(joined, times[5] + 1e-3, 1.5 / RATE)) == 12
    assert len(at_time(joined, times[14], 1.5 / RATE)) == 0


def test_common_times_are_those_of_all_films() -> None:
    seen, times = filmed(0.0, 20)
    one, two = join(seen, times, 0.0), join(seen, times + 5 / RATE, 0.0)
    assert common_times((one, two), (0.0, 0.0), times) == pytest.approx(times[5:])
    assert common_times((one, two), (0.0, 2.5 / RATE), times) == pytest.approx(times[3:])


def in_space(time: float) -> Array:
    phase = 2 * np.pi * BEAT * time + 0.2 * np.arange(12)
    middle = np.column_stack([DOTS / 400 - 0.1, np.full(12, 0.6)])
    return np.asarray(middle + 0.05 * np.column_stack([np.sin(phase), np.cos(phase), 0.5 * np.sin(phase)]))


def film_of(camera: Camera, late: float, rng: np.random.Generator, sigma: float) -> Tracklets:
    """Tracklets of a camera whose clock is ``late`` (s) ahead: what it sees at its time t was there at t - late."""
    times = np.arange(32) / RATE
    seen = [camera.project(in_space(time - late)) for time in times]
    return join([detections(one + sigma * rng.standard_normal(one.shape), sigma) for one in seen], times, 0.0)


def test_the_offset_of_a_clock_is_found_with_its_error() -> None:
    cameras, true = ring((-20.0, 20.0)), 1.3e-3
    ratios, found = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        films = film_of(cameras[0], 0.0, rng, 0.2), film_of(cameras[1], true, rng, 0.2)
        offset = offset_between((cameras[0], cameras[1]), films, np.arange(30) / RATE, 1 / RATE, 4e-3, 0.05)
        found.append(offset.seconds)
        ratios.append((offset.seconds - true) / offset.standard_error)
    assert found == pytest.approx([true] * 3, abs=6e-5)
    assert np.abs(ratios).max() < 4
    assert np.sqrt(np.mean(np.square(ratios))) > 0.2  # the error is not exaggerated


@pytest.mark.parametrize("count", [2, 3])
def test_points_where_rays_meet_are_among_the_possible_ones(count: int) -> None:
    cameras = ring((-25.0, 20.0, 5.0))[:count]
    true, rng = in_space(0.1), np.random.default_rng(8)
    seen = [detections(one.project(true) + SIGMA * rng.standard_normal((12, 2))) for one in cameras]
    cloud = possible_points(cameras, seen, 0.1, (0.0, 10.0))
    apart = np.linalg.norm(cloud.positions[None] - true[:, None], axis=2)
    assert apart.min(1).max() < 5e-4
    nearest = cloud.detections[:, apart.argmin(1)]
    assert np.array_equal(nearest, np.tile(np.arange(12), (count, 1)))
    assert len(np.unique(cloud.detections, axis=1).T) == len(cloud)
    beyond = possible_points(cameras, seen, 0.1, (5.0, 10.0))
    assert len(beyond) == 0


def test_a_marker_that_two_of_three_cameras_see_is_a_point() -> None:
    cameras, true = ring((-25.0, 20.0, 5.0)), in_space(0.1)
    seen = [detections(one.project(true)) for one in cameras]
    seen[1] = seen[1].only(np.arange(12) != 4)
    cloud = possible_points(cameras, seen, 0.1, (0.0, 10.0))
    apart = np.linalg.norm(cloud.positions - true[4], axis=1)
    at = int(apart.argmin())
    assert apart[at] < 1e-6
    assert list(cloud.detections[:, at]) == [4, -1, 4]
    empty = possible_points(cameras, [no_detections()] * 3, 0.1, (0.0, 10.0))
    assert len(empty) == 0
