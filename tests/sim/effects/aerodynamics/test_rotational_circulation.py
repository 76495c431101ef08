"""Circulation of a pitching section, against thin airfoil theory from ahead and from behind."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.moved import Motion, Moved
from tests.sim.kernels.marching import CHORD
from wingfit.sim.kernels.arrays import CIRCULATION, STREAM_C

SPEED = 6.0
THIN = {"L_a": 2 * np.pi, "L_b": 0.0}


@pytest.mark.parametrize("pitching", [0.1, -0.2])
def test_a_section_that_pitches_about_its_leading_edge_has_ellingtons_circulation(pitching: float) -> None:
    """Gamma = pi (3/4 - x_0) c^2 theta' with x_0 = 0, of which the motion of the middle gives the affine law 2/3."""
    moved = Moved("rotational_circulation", {"coefficient": 2 * np.pi}, airspeed=SPEED, genes=THIN)
    moved.rate(Motion(pitch_rate=pitching), moved.z)
    gamma = 0.5 * CHORD * moved.work.loads[:, CIRCULATION]
    np.testing.assert_allclose(gamma, np.pi * 0.75 * CHORD**2 * pitching, rtol=1e-6)


def test_flow_from_behind_sees_the_mirror_image() -> None:
    """There the point that sets circulation is a quarter behind the wing's leading edge: w = theta' c / 4, upwards."""
    moved = Moved("rotational_circulation", {"coefficient": 2 * np.pi}, airspeed=-SPEED, genes=THIN)
    moved.rate(Motion(pitch_rate=0.1), moved.z)
    across = moved.work.loads[:, CIRCULATION] * moved.work.flow[:, STREAM_C]
    np.testing.assert_allclose(across, 2 * np.pi * SPEED * 0.25 * CHORD * 0.1, rtol=1e-6)


def test_it_is_linear_in_the_coefficient_and_nothing_without_pitching() -> None:
    coefficient = np.linspace(-10.0, 10.0, 8)
    moved = Moved(
        "rotational_circulation", {"coefficient": coefficient}, airspeed=SPEED, genes={"L_a": 0.0, "L_b": 0.0}
    )
    moved.rate(Motion(pitch_rate=3.0), moved.z)
    np.testing.assert_allclose(moved.work.loads[0, CIRCULATION], coefficient * 0.25 * CHORD * 3.0, rtol=1e-12)
    moved.rate(Motion(pitch=0.3, heave_rate=1.0, flap_rate=2.0), moved.z)
    assert not moved.work.loads[:, CIRCULATION].any()
