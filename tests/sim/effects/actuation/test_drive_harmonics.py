"""Second to fourth harmonics that the drive adds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.bench import AIR, beat_of, ledger, scene_of
from tests.sim.effects.driving import SLOW, robird, stiff_tracks, turned
from tests.sim.kernels.marching import plank
from wingfit.records import FourierDrive
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import build

X = np.array([1.0, 0.0, 0.0])
PSI = 2 * np.pi * np.arange(64) / 64


def test_both_rods_make_the_same_error_the_rear_one_later_by_its_lag() -> None:
    nominal, other = (
        scene_of("drive_harmonics", robird(), cos2=a, sin3=b, cos4=c).rods
        for a, b, c in ((0.0, 0.0, 0.0), (0.05, -0.08, 0.02))
    )
    size = np.abs(nominal.series[1, 0, 0])
    for rod, lag in ((0, 0.0), (1, AIR.phase_lag)):
        psi = PSI - lag
        error = size * (0.05 * np.cos(2 * psi) - 0.08 * np.sin(3 * psi) + 0.02 * np.cos(4 * psi))
        rate = size * (-0.1 * np.sin(2 * psi) - 0.24 * np.cos(3 * psi) - 0.08 * np.sin(4 * psi))
        found = (other.angles(PSI) - nominal.angles(PSI))[:, rod]
        np.testing.assert_allclose(found[:, 0], np.repeat(error[:, None], 8, axis=1), atol=1e-14)
        np.testing.assert_allclose(found[:, 1], np.repeat(rate[:, None], 8, axis=1), atol=1e-14)


def test_a_drive_of_one_harmonic_has_room_for_more() -> None:
    """Parts of its amplitude, 0.4 rad, whatever the phase of its first harmonic."""
    wing = plank(FourierDrive(0.1, (0.0,), (0.4,)))
    scene = scene_of("drive_harmonics", build(wing, Division.parse("2x1")), sin2=0.1, cos3=0.05)
    expected = 0.1 + 0.4 * (np.sin(PSI) + 0.1 * np.sin(2 * PSI) + 0.05 * np.cos(3 * PSI))
    np.testing.assert_allclose(scene.rods.angles(PSI)[:, 0, 0, 0], expected, atol=1e-14)


def test_a_stiff_wing_swings_so() -> None:
    values = {"cos2": 0.06, "sin2": -0.04, "cos3": 0.05, "sin3": 0.03, "cos4": -0.02, "sin4": 0.01}
    tracks = stiff_tracks("drive_harmonics", 96, **values)
    psi = 2 * np.pi * np.arange(96) / 96
    rods = scene_of("drive_harmonics", robird(), replace(SLOW), cos2=0.0).rods
    added = sum(values[f"cos{k}"] * np.cos(k * psi) + values[f"sin{k}"] * np.sin(k * psi) for k in (2, 3, 4))
    flap = rods.angles(psi)[:, 0, 0, 0] + np.abs(rods.series[1, 0, 0]) * added
    np.testing.assert_allclose(tracks, turned(robird(), flap, X, np.zeros(3)), atol=1e-4)


@pytest.mark.parametrize("end", [-0.1, 0.1])
def test_the_work_of_the_motors_closes_the_ledger(end: float) -> None:
    values = dict.fromkeys(("cos2", "sin2", "cos3", "sin3"), end) | dict.fromkeys(("cos4", "sin4"), 0.5 * end)
    assert ledger(beat_of("drive_harmonics", AIR, 144, "4", {}, **values), AIR.flap_frequency) < 5e-4
