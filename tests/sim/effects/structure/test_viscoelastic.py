from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.bench import Bench, beat_of, excursion, ledger

K, TAU = 0.3, 0.05


@pytest.mark.parametrize("axis", [0, 1])
def test_relaxes_exponentially(axis: int) -> None:
    """A sudden strain makes K k times it, which dies as exp(-t / tau) (Ferry 1980, ch. 1)."""
    bench = Bench.of("viscoelastic", k=K, tau=TAU)
    held = np.concatenate([[0.0], np.full(200, 0.02)])
    moment, _, _, _ = bench.swing(axis, held, 1e-3)
    start = -K * bench.stiffness[axis] * 0.02
    assert moment[1] == pytest.approx(start, rel=0.02)  # one step is not quite sudden
    assert moment[101] / moment[1] == pytest.approx(np.exp(-0.1 / TAU), rel=1e-6)


@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
def test_has_the_complex_modulus_of_the_standard_linear_solid(speed: float) -> None:
    """K k i x / (1 + i x) with x = omega tau, beside the spring that stays."""
    bench = Bench.of("viscoelastic", k=K, tau=TAU)
    n, omega = 128, speed / TAU
    beats = max(2, int(np.ceil(10 * TAU * omega / (2 * np.pi))) + 1)
    psi = 2 * np.pi / n * np.arange(beats * n + 1)
    moment, _, _, _ = bench.swing(0, 0.02 * np.sin(psi), 2 * np.pi / n / omega)
    last = 2 * np.mean(moment[-n:] * np.exp(-1j * psi[-n:])) * 1j / -0.02
    modulus = K * bench.stiffness[0] * 1j * speed / (1 + 1j * speed)
    assert last == pytest.approx(modulus, rel=1e-3)


def test_loses_what_it_does_not_keep() -> None:
    bench = Bench.of("viscoelastic")
    t = np.linspace(0, 1, 301)
    _, kept, lost, given = bench.swing(0, 0.03 * np.sin(20 * t) + 0.01 * np.sin(47 * t), t[1])
    np.testing.assert_allclose(kept + lost, given, atol=1e-6 * given[-1])
    assert np.all(np.diff(lost) >= 0)
    assert lost[-1] > 0.1 * given[-1] > 0


def test_tells_its_derivatives() -> None:
    bench = Bench.of("viscoelastic")
    bench.derivatives(np.zeros(3), np.array([0.4, -0.3, 0.0]), np.array([0.02, -0.01]), [0, 1])


def test_a_relaxed_or_a_frozen_spring_is_none_or_one_more() -> None:
    """Relaxing at once it does nothing; slowly, it is a wing with stiffer springs, that swings less far."""
    plain = excursion(beat_of(""))
    quick, slow = (excursion(beat_of("viscoelastic", k=1.0, tau=tau)) for tau in (0.002, 0.5))
    assert abs(quick / plain - 1) < 0.1 * abs(slow / plain - 1)
    assert slow < plain


def test_ledger_of_the_whole_wing_closes() -> None:
    assert ledger(beat_of("viscoelastic", k=2.0, steps=200), 3.0) < 2e-4
