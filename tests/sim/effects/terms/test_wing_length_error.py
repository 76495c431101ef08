from __future__ import annotations

import pytest

from tests.sim.effects.flown import BESIDE, Values, check_outline


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("part", [-0.2, 0.1])
def test_the_forces_are_those_of_wings_of_that_length(part: float, beside: Values) -> None:
    check_outline("wing_length_error", "r", part, beside)
