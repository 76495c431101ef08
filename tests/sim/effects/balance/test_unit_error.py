from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import seen, wave_forces

UNITS = {"N": 0.0, "gram-force": 1 / 9.80665e-3 - 1, "mN": 999.0, "lbf": 1 / 4.4482216 - 1}


@pytest.mark.parametrize("unit", UNITS)
def test_forces_are_numbers_of_another_unit(unit: str) -> None:
    before = wave_forces()
    found = seen("unit_error", before, part=UNITS[unit]).beat
    np.testing.assert_allclose(found, before.beat * (1.0 + UNITS[unit]), rtol=1e-14)
