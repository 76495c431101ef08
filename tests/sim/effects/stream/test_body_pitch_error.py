from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, flown


@pytest.mark.parametrize(
    ("stated", "part", "angle"),
    [(FAST.condition.angle_of_attack, 0.0, 0.1), (-0.5, -2.0, 0.0), (math.radians(0.5), 180 / math.pi - 1, 0.0)],
    ids=["another zero", "wrong sign", "degrees instead of radians"],
)
def test_it_is_the_right_body_pitch(stated: float, part: float, angle: float) -> None:
    wrong, right = (
        replace(FAST, condition=replace(FAST.condition, angle_of_attack=a))
        for a in (stated, stated * (1 + part) + angle)
    )
    found = flown(DELFLY, wrong, body_pitch_error__part=part, body_pitch_error__angle=angle)
    np.testing.assert_allclose(found, flown(DELFLY, right), atol=1e-13)
    assert np.abs(found - flown(DELFLY, wrong)).max() > 1e-3


def test_it_turns_the_stream_of_everything() -> None:
    """Drag and lift of body and tail, inflow and tip loss of the wake included."""
    turned = replace(FAST, condition=replace(FAST.condition, angle_of_attack=FAST.condition.angle_of_attack - 0.2))
    found = flown(
        DELFLY, FAST, body_pitch_error__angle=-0.2, body_drag__area=0.3, tail_lift__constant=0.2,
        induced_inflow__share=0.5, wake_tip_loss__share=0.5,
    )  # fmt: skip
    expected = flown(
        DELFLY,
        turned,
        body_drag__area=0.3,
        tail_lift__constant=0.2,
        induced_inflow__share=0.5,
        wake_tip_loss__share=0.5,
    )
    np.testing.assert_allclose(found, expected, atol=1e-13)
