"""Prandtl's factor, and what strips of a wing keep of their circulation."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.moved import Motion, Moved
from tests.sim.kernels.marching import LENGTH, plank
from wingfit.sim.effects.contract import measure
from wingfit.sim.effects.library.wake.tip_loss import prandtl, strip_factors
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import CIRCULATION, DRAG, LIFT_SLOPE
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import build


def test_factor_as_printed() -> None:
    """2 / pi arccos(1 / 2) = 2 / 3 where the exponential has fallen to a half; none at the tip, all of it far away."""
    at = np.array([0.0, 0.1 * np.log(2) / np.pi, 10.0])
    np.testing.assert_allclose(prandtl(at, np.array(0.1)), [0.0, 2 / 3, 1.0], atol=1e-12)


@pytest.mark.parametrize("strips", [2, 5, 16])
def test_the_wing_loses_a_length_of_ln_2_over_pi_spacings(strips: int) -> None:
    """Prandtl's effective span, shorter by 0.2206 of the spacing, however the wing is cut."""
    structure, spacing = build(plank(), Division.parse(f"{strips}x1")), np.linspace(0.01, 0.1, LANES)
    lost = (1.0 - strip_factors(structure, spacing)).mean(axis=0) * LENGTH
    np.testing.assert_allclose(lost, spacing * np.log(2) / np.pi, rtol=0.01)


def test_circulation_shrinks_at_the_tip_and_drag_stays() -> None:
    spacing = np.linspace(0.0, 2 * measure(plank(), "chord"), LANES)
    moved = Moved("tip_loss", {"spacing": np.maximum(spacing, 1e-6)}, airspeed=6.0, strips=4)
    bare = Moved("tip_loss", {"spacing": 1e-9}, airspeed=6.0, strips=4)
    for each in (moved, bare):
        each.rate(Motion(pitch=0.1), each.z)
    factor = strip_factors(moved.structure, np.maximum(spacing, 1e-6))
    for load in (CIRCULATION, LIFT_SLOPE):
        np.testing.assert_allclose(moved.work.loads[:, load] / bare.work.loads[:, load], factor, rtol=1e-3)
    np.testing.assert_array_equal(moved.work.loads[:, DRAG], bare.work.loads[:, DRAG])
    assert factor[0].min() > 0.98
    assert np.all(np.diff(factor[-1]) < 0)
    assert np.all(np.diff(factor, axis=0)[:, 1:] <= 0)
