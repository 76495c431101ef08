"""A stroke about another mean angle than described."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.bench import AIR, beat_of, ledger, scene_of
from tests.sim.effects.driving import SLOW, robird, stiff_tracks, turned

X = np.array([1.0, 0.0, 0.0])


@pytest.mark.parametrize("angle", [-0.2, 0.2])
def test_only_the_mean_moves_of_both_rods(angle: float) -> None:
    nominal, moved = (scene_of("stroke_bias", robird(), angle=a).rods.series for a in (0.0, angle))
    np.testing.assert_allclose(moved[0] - nominal[0], angle, rtol=1e-14)
    np.testing.assert_array_equal(moved[1:], nominal[1:])


def test_a_stiff_wing_stands_higher_by_the_angle_at_every_phase() -> None:
    tracks = stiff_tracks("stroke_bias", angle=0.1)
    psi = 2 * np.pi * np.arange(len(tracks)) / len(tracks)
    flap = scene_of("stroke_bias", robird(), SLOW, angle=0.0).rods.angles(psi)[:, 0, 0, 0]
    np.testing.assert_allclose(tracks, turned(robird(), flap + 0.1, X, np.zeros(3)), atol=1e-4)


@pytest.mark.parametrize("end", [-0.2, 0.2])
def test_the_work_of_the_motors_closes_the_ledger(end: float) -> None:
    assert ledger(beat_of("stroke_bias", AIR, 96, angle=end), AIR.flap_frequency) < 1e-4
