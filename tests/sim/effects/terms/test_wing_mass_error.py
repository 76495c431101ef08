from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, flown, refused, without


@pytest.mark.parametrize("part", [-0.5, 0.3])
def test_the_forces_are_those_of_wings_with_that_mass(part: float) -> None:
    other = replace(DELFLY, wing_mass=(1.0 + part) * DELFLY.wing_mass)
    found = flown(DELFLY, FAST, wing_mass_error__part=part)
    np.testing.assert_allclose(found, flown(other, FAST), atol=1e-15)
    assert np.sqrt(np.mean((found - flown(DELFLY, FAST)) ** 2)) > 1e-4


def test_so_is_the_acceleration_of_their_flapping() -> None:
    other = replace(DELFLY, wing_mass=1.3 * DELFLY.wing_mass)
    found = flown(DELFLY, FAST, wing_mass_error__part=0.3, wing_acceleration__share=1.0)
    np.testing.assert_allclose(found, flown(other, FAST, wing_acceleration__share=1.0), atol=1e-15)


def test_it_is_for_models_with_inertia() -> None:
    assert not refused("wing_mass_error", without())
    assert refused("wing_mass_error", without("inertial"))
