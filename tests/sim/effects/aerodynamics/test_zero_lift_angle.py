from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.flown import alone, density, flown, gliding
from wingfit.sim.vehicle.lift_drag import lift_drag


@pytest.mark.parametrize("pitch", [-0.2, 0.0, 0.1, 0.3])
def test_lift_of_a_glider_is_that_at_the_angle_less_the_zero_lift_angle(pitch: float) -> None:
    """(rho / 2) V^2 S C_l sin 2 (alpha - angle), without drag: the force stays across the stream."""
    vehicle, rec = gliding(pitch)
    angle = 0.08
    more = lift_drag(flown(vehicle, rec, alone("translation"), zero_lift_angle__angle=angle, C_l=1.24), 0.0)
    none = lift_drag(flown(vehicle, rec, alone("translation"), C_l=1.24), 0.0)
    per = 0.5 * density(rec) * 9.0 * 0.005 * 1.24
    np.testing.assert_allclose(none[:, 0], per * np.sin(2 * pitch), atol=1e-5 * per)
    np.testing.assert_allclose(more[:, 0], per * np.sin(2 * (pitch - angle)), atol=1e-5 * per)
    np.testing.assert_allclose(more[:, 1], 0.0, atol=1e-9)
