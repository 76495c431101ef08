from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.bouc_wen import hysteretic_angle
from tests.sim.effects.bench import Bench, beat_of, ledger
from wingfit.sim.effects.ports.joints import Joints

K, YIELD = 0.3, 0.1


def largest(bench: Bench) -> float:
    """z where it yields, rad."""
    return YIELD * float(Joints.of(bench.scene.structure).part[bench.at])


@pytest.mark.parametrize(("gamma", "n"), [(0.5, 1.0), (-0.5, 1.0), (0.0, 2.5)])
def test_loop_is_that_of_an_independent_integration(gamma: float, n: float) -> None:
    bench = Bench.of("hysteresis", k=K, yield_angle=YIELD, gamma=gamma, n=n)
    top = largest(bench)
    phi = 2 * top * np.sin(np.linspace(0, 4 * np.pi, 801))
    moment, _, lost, _ = bench.swing(0, phi, 1e-3)
    z = hysteretic_angle(phi, (1 - gamma) / top**n, gamma / top**n, n)
    spring = K * bench.stiffness[0]
    np.testing.assert_allclose(moment, -spring * z, atol=2e-4 * spring * top)
    area = float(np.trapezoid(spring * z[400:], phi[400:]))
    assert lost[800] - lost[400] == pytest.approx(area, rel=1e-3)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_goes_to_its_plateau_exponentially(axis: int, side: float) -> None:
    """z_max = (1 / (beta + gamma))^(1 / n); on the way there, for n = 1, z = z_max (1 - exp(-phi / z_max))."""
    bench = Bench.of("hysteresis", k=K, yield_angle=YIELD, n=1.0)
    top = largest(bench)
    phi = side * np.linspace(0, 12 * top, 601)
    moment, _, _, _ = bench.swing(axis, phi, 1e-3)
    expected = -side * K * bench.stiffness[axis] * top * (1 - np.exp(-np.abs(phi) / top))
    np.testing.assert_allclose(moment, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("gamma", [-0.5, 0.0, 0.5])
@pytest.mark.parametrize("n", [1.0, 4.0])
def test_never_gives_energy(gamma: float, n: float) -> None:
    bench = Bench.of("hysteresis", gamma=gamma, n=n)
    t = np.linspace(0, 1, 401)
    _, kept, lost, given = bench.swing(1, 0.05 * np.sin(20 * t) + 0.03 * np.sin(53 * t), t[1])
    np.testing.assert_allclose(kept + lost, given, atol=1e-3 * given[-1])
    assert np.all(np.diff(lost) >= 0)
    assert lost[-1] > 0.3 * given[-1]


@pytest.mark.parametrize("states", [(0.01, -0.02), (-0.012, 0.03)])
def test_tells_its_derivatives(states: tuple[float, float]) -> None:
    bench = Bench.of("hysteresis", gamma=0.2, n=1.7)
    bench.derivatives(np.zeros(3), np.array([0.4, -0.3, 0.0]), np.array(states), [0, 1])


def test_ledger_of_the_whole_wing_closes() -> None:
    assert ledger(beat_of("hysteresis", k=1.0, steps=200), 3.0) < 1e-3
