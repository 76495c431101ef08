from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, alone, flown, refused, without


@pytest.mark.parametrize("part", [-1.0, 0.3])
def test_all_forces_of_added_mass_grow_in_proportion(part: float) -> None:
    terms = alone("added_mass", "effective_chord")
    found = flown(DELFLY, FAST, terms, added_mass_error__part=part)
    np.testing.assert_allclose(found, (1.0 + part) * flown(DELFLY, FAST, terms), atol=1e-15)


def test_so_do_those_of_a_turning_wing_without_mass() -> None:
    light, terms = replace(DELFLY, wing_mass=1e-12), alone("inertial", "added_mass")
    found = flown(light, FAST, terms, added_mass_error__part=0.3)
    np.testing.assert_allclose(found, 1.3 * flown(light, FAST, terms), atol=1e-9)


def test_it_is_for_models_with_added_mass() -> None:
    assert not refused("added_mass_error", without())
    assert refused("added_mass_error", without("added_mass"))
