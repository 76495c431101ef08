from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import seen, wave_forces


def test_each_force_is_in_the_place_of_the_other() -> None:
    before = wave_forces()
    np.testing.assert_allclose(seen("axis_swap", before, part=1.0).beat, before.beat[..., ::-1], atol=1e-15)


@pytest.mark.parametrize("part", [0.25, 0.5])
def test_the_sum_of_both_stays(part: float) -> None:
    """On the way to the swap, too."""
    before = wave_forces()
    np.testing.assert_allclose(
        seen("axis_swap", before, part=part).beat.sum(axis=2), before.beat.sum(axis=2), atol=1e-15
    )
