from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, freqs

from tests.sim.effects.rigs import TRIAL, harmonic_of, seen, wave_forces


def ratio(harmonic: int, **values: float) -> complex:
    before = wave_forces(harmonic)
    after = seen("filter_delay", before, **values)
    return harmonic_of(after.beat[0, :, 0], harmonic) / harmonic_of(before.beat[0, :, 0], harmonic)


@pytest.mark.parametrize("harmonic", [1, 4])
@pytest.mark.parametrize(("order", "second", "slowness"), [(1, 0.0, 1.0), (2, 0.5, np.sqrt(2))])
def test_is_an_analogue_butterworth_filter(harmonic: int, order: int, second: float, slowness: float) -> None:
    """Of 60 Hz: its delay of slow signals is 1 / omega_c, at second order sqrt(2) times that."""
    cutoff = 2 * np.pi * 60.0
    omega = 2 * np.pi * harmonic * TRIAL.condition.flap_frequency
    expected = freqs(*butter(order, cutoff, analog=True), worN=[omega])[1][0]
    assert ratio(harmonic, delay=slowness / cutoff, second=second) == pytest.approx(expected, rel=1e-9)


def test_a_slow_signal_is_late_by_the_delay_and_the_mean_stays() -> None:
    omega = 2 * np.pi * TRIAL.condition.flap_frequency
    assert np.angle(ratio(1, delay=1e-4, second=1 / 3)) == pytest.approx(-omega * 1e-4, rel=1e-4)
    before = wave_forces()
    after = seen("filter_delay", before, delay=0.02)
    np.testing.assert_allclose(after.beat.mean(axis=1), before.beat.mean(axis=1), atol=1e-15)
