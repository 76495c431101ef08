from __future__ import annotations

import numpy as np

from tests.sim.effects.rigs import seen, wave_forces


def test_the_force_along_one_axis_grows_and_the_other_does_not() -> None:
    before = wave_forces()
    np.testing.assert_allclose(seen("axis_scale", before, x=0.1).beat, before.beat * [1.1, 1.0], atol=1e-15)
    np.testing.assert_allclose(seen("axis_scale", before, z=-0.2).beat, before.beat * [1.0, 0.8], atol=1e-15)


def test_equal_errors_of_both_are_a_scale_error() -> None:
    before = wave_forces()
    both = seen("axis_scale", before, x=0.07, z=0.07).beat
    np.testing.assert_allclose(both, seen("scale_error", before, part=0.07).beat, atol=1e-15)
