from __future__ import annotations

import numpy as np

from tests.sim.effects.flown import DELFLY, FAST, flown, refused, without


def test_with_it_the_model_is_that_with_the_term() -> None:
    np.testing.assert_allclose(flown(DELFLY, FAST, without("inertial"), inertial__share=1.0), flown(), atol=1e-14)
    assert np.abs(flown(DELFLY, FAST, without("inertial")) - flown()).max() > 1e-4


def test_it_is_for_models_without_the_term() -> None:
    assert refused("inertial", without())
    assert not refused("inertial", without("inertial"))
