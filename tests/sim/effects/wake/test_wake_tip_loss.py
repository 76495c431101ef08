from __future__ import annotations

import math

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, flown
from wingfit.sim.effects.library.wake.wake_tip_loss import wake_speed


def test_the_wake_of_a_hovering_disc() -> None:
    """v = sqrt(T / (2 rho A)) (Glauert 1926), and half of T / (2 rho A) / U in a fast stream across."""
    assert wake_speed(np.zeros(1), np.zeros(1), np.array([2.25]))[0] == pytest.approx(1.5, rel=1e-9)
    assert wake_speed(np.zeros(1), np.array([100.0]), np.array([2.25]))[0] == pytest.approx(0.0225, rel=1e-3)


@pytest.mark.parametrize("stream", [(0.0, 1.0), (2.0, 0.5), (0.3, 3.0)])
def test_the_wake_obeys_momentum(stream: tuple[float, float]) -> None:
    axial, across = np.array([stream[0]]), np.array([stream[1]])
    v = wake_speed(axial, across, np.array([2.25])) - axial
    assert v[0] * math.hypot(stream[0] + v[0], stream[1]) == pytest.approx(2.25, rel=1e-9)


def test_it_is_tip_loss_at_the_spacing_of_the_wake() -> None:
    """By which the spacing is the same number of chords only in one condition."""
    share, air = 0.5, FAST.condition
    stroke = 0.34 * 2
    area = min(0.5 * 4 * stroke, math.pi) * 0.137**2
    assert DELFLY.wings == 4
    ratio = np.array([17.4e-3 * 9.80665 / (2 * (101325.0 / 287.05 / 293.15) * area)])
    axial, across = (np.array([air.airspeed * f(air.angle_of_attack)]) for f in (math.cos, math.sin))
    spacing = share * float(wake_speed(axial, across, ratio)[0]) / (2 * 12.5)
    found, expected = flown(wake_tip_loss__share=share), flown(tip_loss__spacing=spacing)
    change = np.abs(expected - flown()).max()
    assert change > 1e-3
    assert np.abs(found - expected).max() < 0.01 * change
