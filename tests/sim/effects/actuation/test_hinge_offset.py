"""The true axis of the driving rods, beside the one that the wing's description has."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.bench import AIR, beat_of, ledger, scene_of
from tests.sim.effects.driving import SLOW, Array, off_axis, robird, rods_of, stiff_tracks, turned
from tests.sim.kernels.marching import ORDER, order

X = np.array([1.0, 0.0, 0.0])
Y, Z = -0.012, 0.02


def place() -> Array:
    hinge = robird().wing.hinge
    return np.array([0.0, hinge.y + Y, hinge.z + Z])


def flap_of(steps: int) -> Array:
    psi = 2 * np.pi * np.arange(steps) / steps
    return np.asarray(scene_of("hinge_offset", robird(), SLOW).rods.angles(psi)[:, 0, 0, 0])


def test_rods_turn_rigidly_about_the_displaced_axis() -> None:
    """Pose and twist at the end of every step from their prescribed acceleration, to one above the method's order."""
    found = [off_axis(rods_of(scene_of("hinge_offset", robird(), y=Y, z=Z), n), X, place()) for n in (48, 96)]
    assert found[1][0] < 1e-8
    assert found[1][1] < 2e-7
    assert order([pose for pose, _ in found]) > ORDER + 0.8
    assert order([twist for _, twist in found]) > ORDER + 0.8


def test_a_stiff_wing_follows_the_displaced_axis() -> None:
    tracks = stiff_tracks("hinge_offset", y=Y, z=Z)
    flap = flap_of(len(tracks))
    np.testing.assert_allclose(tracks, turned(robird(), flap, X, place()), atol=1e-4)
    assert np.abs(tracks - turned(robird(), flap, X, np.zeros(3))).max() > 5e-3


def test_raising_the_axis_carries_the_wing_outboard_on_the_upstroke() -> None:
    """By z sin(flap), and up by z (1 - cos(flap)): nothing at flap angle zero."""
    flap = flap_of(64)
    moved = (stiff_tracks("hinge_offset", z=Z) - turned(robird(), flap, X, np.zeros(3))).mean(axis=1)
    np.testing.assert_allclose(moved[:, 1], Z * np.sin(flap), atol=1e-4)
    np.testing.assert_allclose(moved[:, 2], Z * (1 - np.cos(flap)), atol=1e-4)


@pytest.mark.parametrize("end", [-0.025, 0.025])
def test_the_work_of_the_motors_closes_the_ledger(end: float) -> None:
    assert ledger(beat_of("hinge_offset", AIR, 96, y=end, z=end), AIR.flap_frequency) < 1e-4
