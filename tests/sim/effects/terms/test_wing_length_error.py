from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.flown import BESIDE, DELFLY, FAST, Values, flown


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("part", [-0.2, 0.1])
def test_the_forces_are_those_of_wings_of_that_length(part: float, beside: Values) -> None:
    longer = replace(DELFLY, stations=tuple(replace(one, r=(1.0 + part) * one.r) for one in DELFLY.stations))
    found = flown(DELFLY, FAST, wing_length_error__part=part, **beside)
    np.testing.assert_allclose(found, flown(longer, FAST, **beside), atol=1e-14)
    assert np.sqrt(np.mean((found - flown(DELFLY, FAST, **beside)) ** 2)) > 1e-3
