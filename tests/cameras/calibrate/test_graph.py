"""Poses of cameras from pairs, whatever the order of the pairs, along those that share most views."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wingfit.cameras.calibrate.graph import Link, Pose, camera_poses
from wingfit.records.errors import DatasetError

NAMES = ("a", "b", "c", "d")


def poses() -> list[Pose]:
    """Poses of four cameras in the axes of the first."""
    rng = np.random.default_rng(0)
    turns = Rotation.random(4, rng=rng).as_matrix()
    turns[0], moves = np.eye(3), rng.standard_normal((4, 3))
    moves[0] = 0
    return [Pose(turn, move) for turn, move in zip(turns, moves, strict=True)]


def test_a_motion_and_its_inverse() -> None:
    one, other, point = poses()[1], poses()[2], np.array([1.0, -2.0, 0.5])
    both = other.after(one)
    there = other.rotation @ (one.rotation @ point + one.translation) + other.translation
    np.testing.assert_allclose(both.rotation @ point + both.translation, there, atol=1e-12)
    back = one.inverse.after(one)
    np.testing.assert_allclose(back.rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(back.translation, 0, atol=1e-12)


def test_chains_are_followed_in_both_directions() -> None:
    true = poses()
    # The chain a - c - b - d needs the pair (b, c) backwards.
    links = {(i, j): Link(true[j].after(true[i].inverse), 5) for i, j in ((0, 2), (1, 2), (1, 3))}
    for found, expected in zip(camera_poses(NAMES, links, ""), true, strict=True):
        np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-12)
        np.testing.assert_allclose(found.translation, expected.translation, atol=1e-12)


def test_pairs_with_many_shared_views_are_preferred() -> None:
    true = poses()
    links = {(i, j): Link(true[j].after(true[i].inverse), 9) for i, j in ((0, 1), (1, 2), (2, 3))}
    links[0, 3] = Link(Pose(np.eye(3), np.full(3, 100.0)), 1)
    np.testing.assert_allclose(camera_poses(NAMES, links, "")[3].translation, true[3].translation, atol=1e-12)


def test_cameras_without_a_link_are_named() -> None:
    links = {(0, 1): Link(poses()[1], 5)}
    with pytest.raises(DatasetError, match=r"cameras c, d and the cameras a, b, also through others; do this$"):
        camera_poses(NAMES, links, "do this")
