"""Wagner's and Theodorsen's functions, and a beat of the wing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.oracles.unsteady_airfoil import theodorsen
from tests.sim.effects.moved import Motion, Moved
from tests.sim.kernels.marching import CHORD
from wingfit.sim.effects.library.aerodynamics.circulation_lag import EFFECT, wagner
from wingfit.sim.kernels.arrays import CIRCULATION, LIFT_SLOPE

Array = npt.NDArray[np.float64]

SPEED = 6.0
PLAIN = {"L_a": 5.0, "L_b": 0.0}


def test_after_a_step_circulation_grows_as_wagner_says() -> None:
    share, rate = np.linspace(0.0, 1.5, 8), np.geomspace(3.0, 0.3, 8)
    moved = Moved("circulation_lag", {"share": share, "rate": rate}, airspeed=SPEED, genes=PLAIN)
    step = 0.05 * CHORD / SPEED
    found = moved.march(lambda _: Motion(pitch=0.1), step, 200).loads[:, 0, CIRCULATION]
    s = 2 * SPEED / CHORD * step * np.arange(200)[:, None] * rate
    expected = SPEED * 5.0 * 0.1 * (1 - share * (1 - wagner(s)))
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_wagner_is_that_of_the_exact_theory() -> None:
    """As Garrick (1938) has it, (s + 2) / (s + 4); 1/2 at once and 1 in the end."""
    s = np.linspace(0.0, 20.0, 50)
    np.testing.assert_allclose(wagner(s), (s + 2) / (s + 4), atol=0.03)
    assert wagner(0.0) == pytest.approx(0.5)
    assert wagner(1e3) == pytest.approx(1.0)


@pytest.mark.parametrize(("deficit", "fading"), [(0.283, 0.540), (0.361, 0.381)], ids=["aspect ratio 3", "6"])
def test_a_finite_wing_is_a_smaller_and_faster_lag(deficit: float, fading: float) -> None:
    """R. T. Jones (1940), NACA Report 681: 1 - 0.283 exp(-0.540 s), 1 - 0.361 exp(-0.381 s), relative to the end."""
    s = np.linspace(0.0, 20.0, 200)
    share, rate = next(one for one in EFFECT.size if one.name == "share"), EFFECT.shape[0]
    errors = [
        np.abs(a * (1 - wagner(b * s)) - deficit * np.exp(-fading * s)).max()
        for a in np.linspace(share.lower, share.upper, 76)
        for b in np.geomspace(rate.lower, rate.upper, 60)
    ]
    assert min(errors) < 0.03


def test_a_heaving_section_has_theodorsens_lift() -> None:
    """Amplitude and phase of the circulatory lift at eight reduced frequencies, to the accuracy of Jones's fit."""
    k, omega, n = np.array([0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.5]), 20.0, 200
    moved = Moved("circulation_lag", {"share": 1.0}, airspeed=0.5 * omega * CHORD / k, genes=PLAIN)
    step, turn = 2 * np.pi / (omega * n), np.exp(-2j * np.pi * np.arange(n) / n)

    def heave(t: float) -> Motion:
        return Motion(heave_rate=-1e-5 * np.cos(omega * t))

    moved.march(heave, step, n)
    fading = np.array(moved.work.z_tangent[0])
    moved.z = moved.z / -np.expm1(-fading * n * step)  # from here the beat closes on itself
    found = moved.march(heave, step, n).loads[:, 0, CIRCULATION]
    ratio = 2 / n * turn @ found / (5.0 * 1e-5)
    np.testing.assert_allclose(ratio, theodorsen(k), atol=0.025)


def test_the_slope_is_that_of_what_acts_at_once() -> None:
    moved = Moved("circulation_lag", {"share": 1.0}, airspeed=SPEED, genes=PLAIN)
    moved.rate(Motion(pitch=0.1), moved.z)
    np.testing.assert_allclose(moved.work.loads[:, LIFT_SLOPE], 0.5 * 5.0 * SPEED, rtol=1e-6)


def test_decay_is_the_states_own_derivative() -> None:
    moved = Moved("circulation_lag", {"rate": np.geomspace(0.3, 3.0, 8)}, airspeed=SPEED)
    described, found = moved.decay(Motion(pitch=0.1), moved.z + 0.3)
    np.testing.assert_allclose(described, found, rtol=1e-6)


def test_nothing_happens_without_flow() -> None:
    """In still air no half chord is travelled: states neither move nor fail."""
    moved = Moved("circulation_lag", {"share": 1.5})
    assert np.abs(moved.rate(Motion(pitch=0.3), moved.z + 0.1)).max() < 1e-6
