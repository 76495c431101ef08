from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, flown


@pytest.mark.parametrize(
    ("stated", "part"),
    [(-0.5, -2.0), (math.radians(0.5), 180 / math.pi - 1)],
    ids=["wrong sign", "degrees instead of radians"],
)
def test_it_is_the_right_body_pitch(stated: float, part: float) -> None:
    wrong, right = (
        replace(FAST, condition=replace(FAST.condition, angle_of_attack=a)) for a in (stated, stated * (1 + part))
    )
    found = flown(DELFLY, wrong, body_pitch_convention__part=part)
    np.testing.assert_allclose(found, flown(DELFLY, right), atol=1e-13)
    assert np.abs(found - flown(DELFLY, wrong)).max() > 1e-3
