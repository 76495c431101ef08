"""The true axis of the driving rods, at an angle to the one that the wing's description has."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.sim.effects.bench import AIR, beat_of, ledger, scene_of
from tests.sim.effects.driving import SLOW, off_axis, robird, rods_of, stiff_tracks, turned
from tests.sim.kernels.marching import ORDER, order

Y, Z = 0.08, -0.05
AXIS = Rotation.from_rotvec([0.0, Y, Z]).apply([1.0, 0.0, 0.0])
HINGE = np.array([0.0, robird().wing.hinge.y, robird().wing.hinge.z])


def test_rods_turn_rigidly_about_the_tilted_axis() -> None:
    """Pose and twist at the end of every step from their prescribed acceleration, to one above the method's order."""
    found = [off_axis(rods_of(scene_of("hinge_tilt", robird(), y=Y, z=Z), n), AXIS, HINGE) for n in (48, 96)]
    assert found[1][0] < 1e-8
    assert found[1][1] < 2e-7
    assert order([pose for pose, _ in found]) > ORDER + 0.8
    assert order([twist for _, twist in found]) > ORDER + 0.8


def test_the_axis_is_a_unit_vector_turned_the_right_way() -> None:
    """About y by a positive angle, the end of the axis that points aft sinks; about z it moves outboard."""
    hinge = scene_of("hinge_tilt", robird(), y=0.2, z=0.2).lanes.hinge[:3, 0]
    assert np.linalg.norm(hinge) == pytest.approx(1.0, abs=1e-15)
    assert hinge[1] == pytest.approx(-hinge[2])
    assert hinge[1] > 0


def test_a_stiff_wing_follows_the_tilted_axis() -> None:
    tracks = stiff_tracks("hinge_tilt", y=Y, z=Z)
    psi = 2 * np.pi * np.arange(len(tracks)) / len(tracks)
    flap = scene_of("hinge_tilt", robird(), SLOW).rods.angles(psi)[:, 0, 0, 0]
    np.testing.assert_allclose(tracks, turned(robird(), flap, AXIS, HINGE), atol=1e-4)
    assert np.abs(tracks - turned(robird(), flap, np.array([1.0, 0.0, 0.0]), HINGE)).max() > 5e-3


@pytest.mark.parametrize("end", [-0.2, 0.2])
def test_the_work_of_the_motors_closes_the_ledger(end: float) -> None:
    assert ledger(beat_of("hinge_tilt", AIR, 128, y=end, z=end), AIR.flap_frequency) < 1e-4
