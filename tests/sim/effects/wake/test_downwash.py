from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, alone, density, flown, gliding, without
from wingfit.sim.vehicle.lift_drag import lift_drag

SPAN, CHORD, SPEED, C_L = 0.1, 0.05, 3.0, 1.3


@pytest.mark.parametrize("share", [0.5, 1.0, 4.0])
def test_a_glider_at_small_angles_has_the_induced_drag_of_a_lifting_line(share: float) -> None:
    """Gamma = Gamma_0 / (1 + share C_l c / (2 b)), and the drag is that lift times w / V (Glauert 1926)."""
    vehicle, rec = gliding(-0.01)
    before = lift_drag(flown(vehicle, rec, alone("translation"), C_l=C_L), 0.0)[0]
    after = lift_drag(flown(vehicle, rec, alone("translation"), downwash__share=share, C_l=C_L), 0.0)[0]
    assert after[0] / before[0] == pytest.approx(1.0 / (1.0 + share * C_L * CHORD / (2 * SPAN)), rel=1e-3)
    w = share * abs(after[0]) / (density(rec) * SPEED * SPAN) / (2 * SPAN)
    assert after[1] - before[1] == pytest.approx(abs(after[0]) * w / SPEED, rel=2e-3)


def test_it_takes_energy_from_a_vehicle() -> None:
    """The mean drag in fast flight grows."""
    before, after = (lift_drag(flown(DELFLY, FAST, without(), **more), 0.5).mean(axis=0)
                     for more in ({}, {"downwash__share": 1.0}))  # fmt: skip
    assert np.isfinite(after).all()
    assert after[0] < before[0]
