from __future__ import annotations

import numpy as np

from tests.sim.effects.rigs import phases, rigid_tracks, seen

DISTANCE, BASE, Y = 1.5, 0.6, 0.25
CAMERAS = {"x": 0.1, "y": Y, "distance": DISTANCE, "base": BASE / DISTANCE}


def test_depth_error_of_a_marker_that_slides_along_the_base() -> None:
    """y = y0 + a sin(psi) in a plane at z: disparity is short by (y(t + d) - y(t)) / depth, by hand."""
    a, z, delay = 0.05, 0.2, 0.004
    before = rigid_tracks()
    psi = phases()[:, None]
    turn = 2 * np.pi * before.recording.condition.flap_frequency * delay
    before.beat[0, ..., 1], before.beat[0, ..., 2] = 0.3 + a * np.sin(psi), z
    x = before.beat[0, ..., 0].copy()
    after = seen("camera_desync", before, delay=delay, **CAMERAS).beat[0]
    early, late = 0.3 + a * np.sin(psi), 0.3 + a * np.sin(psi + turn)
    disparity = (early - (Y - BASE / 2) - late + (Y + BASE / 2)) / (DISTANCE - z)
    depth = BASE / disparity
    middle = (0.5 * (early + late) - Y) / (DISTANCE - z)
    np.testing.assert_allclose(after[..., 2], np.broadcast_to(DISTANCE - depth, after.shape[:2]), atol=1e-13)
    np.testing.assert_allclose(after[..., 1], np.broadcast_to(Y + middle * depth, after.shape[:2]), atol=1e-13)
    np.testing.assert_allclose(after[..., 0], 0.1 + (x - 0.1) / (DISTANCE - z) * depth, atol=1e-13)


def test_what_moves_outwards_seems_lower() -> None:
    """The outer camera has it farther out already, as if rays met beyond it; a negative delay does the opposite."""
    before = rigid_tracks()
    psi = phases()
    before.beat[0, ..., 1] = 0.3 + 0.05 * np.sin(psi)[:, None]
    before.beat[0, ..., 2] = 0.0
    for delay in (0.002, -0.002):
        after = seen("camera_desync", before, delay=delay, **CAMERAS).beat[0]
        assert np.all(after[np.cos(psi) > 0.5, :, 2] * delay < 0)


def test_at_rest_nothing_is_seen_of_it() -> None:
    before = rigid_tracks(0.0)
    np.testing.assert_allclose(seen("camera_desync", before, delay=0.01).beat, before.beat, atol=1e-13)
