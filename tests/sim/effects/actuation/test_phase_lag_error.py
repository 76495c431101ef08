"""A rear rod that lags more than the condition says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.bench import AIR, Array, beat_of, ledger, scene_of
from tests.sim.effects.driving import robird

PSI = 2 * np.pi * np.arange(64) / 64


def angles(lag: float, error: float) -> Array:
    """[n, 2, 5]: of both rods."""
    scene = scene_of("phase_lag_error", robird(), replace(AIR, phase_lag=lag), angle=error)
    return scene.rods.angles(PSI)[..., 0]


@pytest.mark.parametrize("error", [-0.15, 0.02, 0.15])
def test_is_the_same_as_a_condition_with_that_lag(error: float) -> None:
    """All derivatives of the rear rod; the front rod does not move."""
    np.testing.assert_allclose(angles(0.05, error), angles(0.05 + error, 0.0), atol=1e-13)
    np.testing.assert_array_equal(angles(0.05, error)[:, 0], angles(0.05, 0.0)[:, 0])


def test_a_late_rear_rod_is_lower_on_the_upstroke() -> None:
    rear, late = angles(0.0, 0.0)[:, 1], angles(0.0, 0.02)[:, 1]
    moving = np.abs(rear[:, 1]) > 0.1
    assert np.all((rear - late)[moving, 0] * rear[moving, 1] > 0)


def test_the_wing_moves_as_if_the_condition_had_that_lag() -> None:
    described = beat_of("phase_lag_error", AIR, 64, angle=0.03)
    true = beat_of("phase_lag_error", replace(AIR, phase_lag=AIR.phase_lag + 0.03), 64, angle=0.0)
    np.testing.assert_allclose(described.tracks, true.tracks, atol=5e-6)
    assert np.abs(described.tracks - beat_of("phase_lag_error", AIR, 64, angle=0.0).tracks).max() > 1e-3


@pytest.mark.parametrize("end", [-0.15, 0.15])
def test_the_work_of_the_motors_closes_the_ledger(end: float) -> None:
    assert ledger(beat_of("phase_lag_error", AIR, 96, angle=end), AIR.flap_frequency) < 1e-4
