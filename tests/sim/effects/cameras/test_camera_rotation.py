from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.sim.effects.rigs import rigid_tracks, seen
from wingfit.sim.effects.library.cameras.camera_rotation import rotation


@pytest.mark.parametrize("turn", [(0.1, -0.2, 0.15), (0.0, 0.0, 1e-9), (3.0, 0.5, -0.5), (1e-5, 2e-5, 0.0)])
def test_rotation_is_that_of_an_independent_library(turn: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(rotation(np.array([turn]))[0], Rotation.from_rotvec(turn).as_matrix(), atol=1e-15)


def test_all_markers_turn_about_the_origin() -> None:
    before = rigid_tracks()
    after = seen("camera_rotation", before, x=0.05, y=-0.03, z=0.1)
    R = Rotation.from_rotvec((0.05, -0.03, 0.1))
    np.testing.assert_allclose(after.beat[0].reshape(-1, 3), R.apply(before.beat[0].reshape(-1, 3)), atol=1e-15)


def test_a_positive_turn_about_x_lifts_the_tip() -> None:
    before = rigid_tracks(0.0)
    assert np.all(seen("camera_rotation", before, x=0.02).beat[..., 2] > before.beat[..., 2])


def test_distances_between_markers_stay() -> None:
    before = rigid_tracks()
    after = seen("camera_rotation", before, x=0.2, y=0.2, z=-0.2)
    for a, b in ((0, 48), (3, 40)):
        lengths = [np.linalg.norm(s.beat[0, :, a] - s.beat[0, :, b], axis=-1) for s in (before, after)]
        np.testing.assert_allclose(lengths[1], lengths[0], rtol=1e-13)
