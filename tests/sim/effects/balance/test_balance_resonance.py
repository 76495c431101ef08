from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.sim.effects.rigs import TRIAL, harmonic_of, seen, wave_forces

FREQUENCY = TRIAL.condition.flap_frequency


def ratio(harmonic: int, **values: float) -> complex:
    before = wave_forces(harmonic)
    after = seen("balance_resonance", before, **values)
    return harmonic_of(after.beat[0, :, 1], harmonic) / harmonic_of(before.beat[0, :, 1], harmonic)


def test_at_resonance_the_force_is_a_quarter_turn_late_and_large() -> None:
    """1 / (2 i zeta) there, and 1 far below; of which ``part`` is mixed in."""
    assert ratio(4, part=1.0, frequency=4 * FREQUENCY, damping=0.02) == pytest.approx(-25j, abs=1e-9)
    assert ratio(4, part=0.1, frequency=4 * FREQUENCY, damping=0.02) == pytest.approx(0.9 - 2.5j, abs=1e-9)
    before = wave_forces()
    after = seen("balance_resonance", before, part=1.0)
    np.testing.assert_allclose(after.beat.mean(axis=1), before.beat.mean(axis=1), atol=1e-15)


def test_is_the_spring_force_of_an_oscillator_integrated_in_time() -> None:
    """x'' + 2 zeta w x' + w^2 x = w^2 F settles at the amplitude and phase of the third harmonic."""
    omega, zeta = 2 * np.pi * 60.0, 0.3
    drive = 2 * np.pi * 3 * FREQUENCY

    def rate(t: float, s: list[float]) -> list[float]:
        return [s[1], omega**2 * (np.sin(drive * t) - s[0]) - 2 * zeta * omega * s[1]]

    times = np.linspace(1.0, 1.0 + 4 / FREQUENCY, 400)
    found = solve_ivp(rate, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12).y[0]
    basis = np.stack([np.sin(drive * times), np.cos(drive * times)], axis=1)
    sine, cosine = np.linalg.lstsq(basis, found, rcond=None)[0]
    assert ratio(3, part=1.0, frequency=60.0, damping=zeta) == pytest.approx(complex(sine, cosine), abs=1e-6)
