from __future__ import annotations

import numpy as np

from tests.sim.effects.rigs import rigid_tracks, seen


def test_every_marker_is_off_by_the_same_vector() -> None:
    before = rigid_tracks()
    after = seen("camera_shift", before, x=0.01, y=-0.004, z=0.002)
    offset = after.beat - before.beat
    np.testing.assert_allclose(offset, np.broadcast_to([0.01, -0.004, 0.002], offset.shape), atol=1e-15)
    assert np.array_equal(after.times, before.times)
