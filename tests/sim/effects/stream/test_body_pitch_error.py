from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.sim.effects.flown import DELFLY, FAST, flown


def test_it_is_another_zero_of_the_body_pitch() -> None:
    right = replace(FAST, condition=replace(FAST.condition, angle_of_attack=FAST.condition.angle_of_attack + 0.1))
    found = flown(DELFLY, FAST, body_pitch_error__angle=0.1)
    np.testing.assert_allclose(found, flown(DELFLY, right), atol=1e-13)
    assert np.abs(found - flown(DELFLY, FAST)).max() > 1e-3


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
