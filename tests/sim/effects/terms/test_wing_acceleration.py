from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.sim.effects.flown import DELFLY, FAST, alone, flown, refused, without


def test_with_it_the_model_is_that_with_the_term() -> None:
    whole = flown(DELFLY, FAST, (*without(), "wing_acceleration"))
    np.testing.assert_allclose(flown(wing_acceleration__share=1.0), whole, atol=1e-14)
    assert np.abs(flown() - whole).max() > 1e-4
    assert refused("wing_acceleration", (*without(), "wing_acceleration"))


def test_in_vacuum_both_parts_of_the_inertia_cancel_along_the_body() -> None:
    """A wing whose mass lies on its axis moves in the flapping direction only; each part alone says otherwise."""
    vacuum = replace(FAST, condition=replace(FAST.condition, pressure=1e-6, airspeed=0.0))
    part = np.abs(flown(DELFLY, vacuum, alone("inertial"))).max()
    assert part > 1e-3
    assert np.abs(flown(DELFLY, vacuum, alone("inertial"), wing_acceleration__share=1.0)).max() < 1e-6 * part
