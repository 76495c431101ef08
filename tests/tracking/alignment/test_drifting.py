"""Slow motion of a body without markers on it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tests.tracking.alignment.recorded import Filmed, filmed
from wingfit.records.array_types import Array
from wingfit.tracking.alignment import Known, Tracks, align
from wingfit.tracking.alignment.body_motion import without_slow_motion
from wingfit.tracking.alignment.rigid_motion import rigid_motion

FAR = np.array([1.5, -2.0, 3.0])  # m, from the origin of the cameras


def drifting(film: Filmed, away: Array) -> Tracks:
    """Return the tracks of ``film`` on a body that turns by up to 12 deg and moves by 0.5 m, ``away`` [3] m."""
    tracks = film.tracks
    s = np.linspace(-1, 1, len(tracks.times))[:, None]
    turning = Rotation.from_rotvec(np.radians(7) * s * [0.7, 0.5, -0.5] + np.radians(4) * (s**2 - 1 / 3) * [0.0, 1, 1])
    shift = 0.25 * np.concatenate([s, 0.5 * s**2, -s], axis=1)
    middle = np.nanmean(tracks.positions, axis=(0, 1))
    moved = np.einsum("tij,tkj->tki", turning.as_matrix(), tracks.positions - middle) + shift[:, None] + away
    return Tracks(tracks.file, tracks.times, tracks.names, moved)


def test_the_pivot_is_near_the_tracks_wherever_the_cameras_are() -> None:
    points = filmed(1).tracks.positions
    near, far = rigid_motion(points), rigid_motion(points + 5 * FAR)
    size = float(np.linalg.norm(np.nanstd(near.shape, axis=0)))
    assert np.linalg.norm(near.pivot - np.nanmean(near.shape, axis=0)) < 3 * size
    assert np.linalg.norm(far.pivot - near.pivot - 5 * FAR) < 0.05 * size


def test_slow_motion_is_removed_alike_wherever_the_cameras_are() -> None:
    film = filmed(1)
    frames = np.arange(len(film.tracks.times))
    left = list[Array]()
    for away in (np.zeros(3), 5 * FAR):
        removed, words, order = without_slow_motion(film.tracks.times, drifting(film, away).positions, frames)
        assert words
        assert order == 2
        left.append(removed - np.nanmean(removed, axis=(0, 1)))
    assert np.nanmax(np.abs(left[1] - left[0])) < 1e-4  # m


def test_a_drifting_body_far_from_the_origin_has_the_frame_of_a_resting_one() -> None:
    film = filmed(1)
    rests = align(film.tracks, film.wing, Known(side="right"))
    drifts = align(drifting(film, FAR), film.wing, Known(side="right"))
    order = [drifts.markers.index(name) for name in rests.markers]
    a, b = drifts.positions[:, order], rests.positions
    both = np.isfinite(a[..., 0]) & np.isfinite(b[..., 0])
    turned, _ = Rotation.align_vectors(a[both] - a[both].mean(axis=0), b[both] - b[both].mean(axis=0))
    apart = turned.as_rotvec() / np.hypot(drifts.rotation_error, rests.rotation_error)
    assert np.abs(apart).max() < 2
    assert np.linalg.norm(a[both] - b[both], axis=-1).max() < 4e-3  # m
