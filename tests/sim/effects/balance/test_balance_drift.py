from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import seen, wave_forces

WEIGHT = 17.4e-3 * 9.80665


@pytest.mark.parametrize("axes", ["xz", "x", "z"])
def test_steady_drift_grows_with_time(axes: str) -> None:
    before = wave_forces(axes=axes)
    before.times += 5.0  # counts from the first sample, whenever that is
    after = seen("balance_drift", before, x=0.01, z=-0.02)
    rate = {"xz": [0.01, -0.02], "x": [0.01], "z": [-0.02]}[axes]
    expected = (before.times[0] - 5.0)[:, None] * np.array(rate) * WEIGHT
    np.testing.assert_allclose(after.added[0], expected, atol=1e-15)


def test_warming_reaches_63_percent_after_its_time() -> None:
    before = wave_forces()
    before.times[0] = np.linspace(0.0, 100.0, before.times.shape[1])
    before.times[0, 1] = 2.5
    after = seen("balance_drift", before, thermal_x=0.1, thermal_z=-0.05, time=2.5).added[0]
    np.testing.assert_allclose(after[0], 0.0)
    np.testing.assert_allclose(after[1], np.array([0.1, -0.05]) * WEIGHT * (1 - np.exp(-1)), rtol=1e-13)
    np.testing.assert_allclose(after[-1], np.array([0.1, -0.05]) * WEIGHT, rtol=1e-12)
