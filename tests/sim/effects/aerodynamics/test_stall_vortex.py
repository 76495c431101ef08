from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, flown, gliding, without

STALL = {"angle": 0.4, "width": 0.08, "delay": 0.5, "advance": 2.0}


def stalled(name: str, **values: float) -> dict[str, float]:
    """Genes of an effect with the parameters of stall."""
    return {f"{name}__{key}": value for key, value in (STALL | {"share": 0.6} | values).items()}


def test_without_the_vortex_it_is_dynamic_stall() -> None:
    plain = flown(DELFLY, FAST, without(), **stalled("dynamic_stall"))
    found = flown(DELFLY, FAST, without(), **stalled("stall_vortex", vortex=0.0, chords=3.0))
    np.testing.assert_allclose(found, plain, atol=1e-13)


def test_a_vortex_that_stays_for_ever_carries_all_but_the_mean_of_what_is_lost() -> None:
    """And one that leaves at once carries nothing."""
    attached, plain = flown(), flown(DELFLY, FAST, without(), **stalled("dynamic_stall"))
    fleeting, staying = (
        flown(DELFLY, FAST, without(), **stalled("stall_vortex", vortex=1.0, chords=chords)) for chords in (0.5, 10.0)
    )
    lost = np.abs(plain - attached).mean()
    assert np.abs(fleeting - plain).mean() < np.abs(staying - plain).mean() < 1.5 * lost


@pytest.mark.parametrize("pitch", [0.2, 0.6])
def test_in_steady_flow_no_vortex_is_fed(pitch: float) -> None:
    vehicle, rec = gliding(-pitch)
    plain = flown(vehicle, rec, ("translation",), **stalled("dynamic_stall"))
    found = flown(vehicle, rec, ("translation",), **stalled("stall_vortex", vortex=1.0, chords=3.0))
    np.testing.assert_allclose(found, plain, atol=1e-9)
