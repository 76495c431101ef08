from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.flown import FAST, alone, density, flown, gliding
from wingfit.sim.vehicle.lift_drag import lift_drag


@pytest.mark.parametrize("pitch", [-0.6, 0.0, 0.2, 0.5, 1.2])
@pytest.mark.parametrize("change", [-1.0, 0.4])
def test_the_force_of_a_glider_along_its_chord_changes_in_proportion(pitch: float, change: float) -> None:
    """The lift L is L cos alpha along the normal, which stays, and (1 + change) L sin alpha along the chord."""
    vehicle, rec = gliding(pitch)
    found = lift_drag(flown(vehicle, rec, alone("translation"), leading_edge_suction__change=change, C_l=1.24), 0.0)
    per = 0.5 * density(rec) * 9.0 * 0.005 * 1.24
    lift, along = per * np.sin(2 * pitch), change * per * np.sin(2 * pitch) * np.sin(pitch)
    np.testing.assert_allclose(found[:, 0], lift + along * np.sin(pitch), atol=1e-5 * per)
    np.testing.assert_allclose(found[:, 1], -along * np.cos(pitch), atol=1e-5 * per)


def test_without_suction_a_thin_wing_has_no_force_along_its_chord() -> None:
    vehicle, rec = gliding(0.3)
    found = lift_drag(flown(vehicle, rec, alone("translation"), leading_edge_suction__change=-1.0, C_l=1.24), 0.0)
    np.testing.assert_allclose(found[:, 1], found[:, 0] * np.tan(0.3), rtol=1e-4)


def test_the_force_by_pitching_does_not_change() -> None:
    with_it, none = (flown(terms=alone("rotation"), leading_edge_suction__change=k) for k in (0.4, 0.0))
    np.testing.assert_allclose(with_it, none, atol=1e-12)
    whole = flown(rec=FAST, leading_edge_suction__change=0.4) - flown(rec=FAST)
    half = flown(rec=FAST, leading_edge_suction__change=0.2) - flown(rec=FAST)
    np.testing.assert_allclose(whole, 2.0 * half, atol=1e-9, err_msg="linear in the gene")
    assert np.sqrt(np.mean(whole**2)) > 1e-3
