from __future__ import annotations

import numpy as np

from tests.sim.effects.rigs import seen, wave_forces


def test_one_axis_is_mirrored_and_the_other_is_not() -> None:
    before = wave_forces()
    np.testing.assert_allclose(seen("axis_sign", before, x=1.0).beat, before.beat * [-1.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(seen("axis_sign", before, z=1.0).beat, before.beat * [1.0, -1.0], atol=1e-15)
