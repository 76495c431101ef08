from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import seen, wave_forces


@pytest.mark.parametrize(("axes", "expected"), [("xz", [0.02, -0.1]), ("x", [0.02]), ("z", [-0.1])])
def test_a_constant_in_weights_along_the_axes_recorded(axes: str, expected: list[float]) -> None:
    """The DelFly weighs 17.4 g."""
    after = seen("balance_offset", wave_forces(axes=axes), x=0.02, z=-0.1)
    forces = np.array(expected) * 17.4e-3 * 9.80665
    np.testing.assert_allclose(after.added, np.broadcast_to(forces, after.added.shape), rtol=1e-14)
