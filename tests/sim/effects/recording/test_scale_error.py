from __future__ import annotations

import numpy as np

from tests.sim.effects.rigs import rigid_tracks, seen, wave_forces


def test_lengths_grow_by_the_part() -> None:
    before = rigid_tracks()
    after = seen("scale_error", before, part=0.05)
    for a, b in ((0, 48), (3, 40)):
        lengths = [np.linalg.norm(s.beat[0, :, a] - s.beat[0, :, b], axis=-1) for s in (before, after)]
        np.testing.assert_allclose(lengths[1], 1.05 * lengths[0], rtol=1e-13)


def test_forces_shrink_by_a_negative_part() -> None:
    before = wave_forces()
    np.testing.assert_allclose(seen("scale_error", before, part=-0.1).beat, 0.9 * before.beat, rtol=1e-14)
