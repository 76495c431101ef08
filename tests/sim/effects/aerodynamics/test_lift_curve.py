from __future__ import annotations

import math

import numpy as np
import pytest

from tests.sim.effects.flown import FAST, alone, density, flown, gliding
from wingfit.sim.vehicle.lift_drag import lift_drag


@pytest.mark.parametrize("pitch", [-0.6, 0.0, 0.2, 0.5, 1.2])
def test_lift_of_a_glider_has_a_term_of_four_times_the_angle(pitch: float) -> None:
    """(rho / 2) V^2 S C_l (sin 2 alpha + fourth sin 4 alpha), without drag: the force stays across the stream."""
    vehicle, rec = gliding(pitch)
    found = lift_drag(flown(vehicle, rec, alone("translation"), lift_curve__fourth=0.2, C_l=1.24), 0.0)
    per = 0.5 * density(rec) * 9.0 * 0.005 * 1.24
    np.testing.assert_allclose(found[:, 0], per * (np.sin(2 * pitch) + 0.2 * np.sin(4 * pitch)), atol=1e-5 * per)
    np.testing.assert_allclose(found[:, 1], 0.0, atol=1e-9)


def test_at_45_degrees_nothing_changes() -> None:
    vehicle, rec = gliding(math.pi / 4)
    with_it, none = (flown(vehicle, rec, alone("translation"), lift_curve__fourth=k, C_l=1.24) for k in (0.4, 0.0))
    np.testing.assert_allclose(with_it, none, rtol=1e-5)


def test_the_circulation_by_pitching_does_not_change() -> None:
    with_it, none = (flown(terms=alone("rotation"), lift_curve__fourth=k) for k in (0.4, 0.0))
    np.testing.assert_allclose(with_it, none, atol=1e-12)
    whole = flown(rec=FAST, lift_curve__fourth=0.4) - flown(rec=FAST, lift_curve__fourth=0.0)
    half = flown(rec=FAST, lift_curve__fourth=0.2) - flown(rec=FAST, lift_curve__fourth=0.0)
    np.testing.assert_allclose(whole, 2.0 * half, atol=1e-9, err_msg="linear in the gene")
    assert np.sqrt(np.mean(whole**2)) > 1e-3
