from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import seen, wave_forces


def test_axes_nose_up_see_a_force_forward_as_downward_in_part() -> None:
    """x forward, z down: with x tilted up, a forward force has a part along the tilted z, which now points forward."""
    before = wave_forces()
    before.beat[..., 0], before.beat[..., 1] = 1.0, 0.0
    after = seen("balance_tilt", before, angle=0.1).beat[0, 0]
    assert after == pytest.approx([np.cos(0.1), np.sin(0.1)])
    before.beat[..., 0], before.beat[..., 1] = 0.0, 1.0
    assert seen("balance_tilt", before, angle=0.1).beat[0, 0] == pytest.approx([-np.sin(0.1), np.cos(0.1)])


def test_the_size_of_the_force_stays() -> None:
    before = wave_forces()
    after = seen("balance_tilt", before, angle=-0.2)
    np.testing.assert_allclose(np.hypot(*after.beat[0].T), np.hypot(*before.beat[0].T), rtol=1e-14)
