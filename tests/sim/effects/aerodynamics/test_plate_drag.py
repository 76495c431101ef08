"""Pressure drag of a plate: square to it, growing with the square of the stream there, and only taking energy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.sim.effects.moved import Motion, Moved
from tests.sim.kernels.marching import CHORD, LENGTH
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import DRAG_SLOPE, PITCH_RATE, PUSH_C, PUSH_M, PUSH_N, STREAM_N
from wingfit.sim.kernels.integrate import forces

Array = npt.NDArray[np.float64]

WIND = 6.0


def bare(coefficient: float, airspeed: float = 0.0) -> Moved:
    """No other force of the air."""
    moved = Moved("plate_drag", {"coefficient": coefficient}, airspeed=airspeed)
    moved.lanes.coefficients[:] = 0.0
    return moved


def forced(moved: Moved, motion: Motion) -> Moved:
    moved.rate(motion, moved.z)
    forces(moved.structure.wiring, moved.here, moved.lanes, moved.work)
    return moved


def test_normal_force_has_the_square_of_the_sine() -> None:
    alpha = np.radians([-90.0, -40.0, -10.0, 0.0, 5.0, 20.0, 60.0, 90.0])
    moved = forced(bare(1.3, WIND), Motion(pitch=alpha))
    dynamic = 0.5 * moved.here.density * WIND**2 * CHORD * LENGTH
    normal = 1.3 * np.abs(np.sin(alpha)) * np.sin(alpha) * dynamic
    expected = [normal * np.sin(alpha), 0.0 * alpha, normal * np.cos(alpha)]
    np.testing.assert_allclose(moved.work.air_force, expected, atol=1e-12)
    assert not moved.work.loads[:, PUSH_C].any()


def test_a_plate_that_pitches_about_its_middle_is_held_back() -> None:
    """Moment rho / 2 C |theta'| theta' c^4 / 32 per span against it, no force; to 1 %."""
    rate = np.array([-9.0, -3.0, -1.0, 0.5, 1.0, 2.0, 4.0, 8.0])
    moved = bare(1.2)
    moved.rate(Motion(pitch_rate=rate, heave_rate=0.5 * CHORD * rate), moved.z)  # pitches about the leading edge
    np.testing.assert_allclose(moved.work.flow[:, STREAM_N], 0.0, atol=1e-12)
    np.testing.assert_allclose(moved.work.loads[0, PUSH_N], 0.0, atol=1e-12)
    np.testing.assert_allclose(moved.work.loads[0, PUSH_M], -1.2 * np.abs(rate) * rate * CHORD**3 / 32, rtol=0.01)


def test_pitching_in_a_stream_is_the_integral_over_the_chord() -> None:
    """Exact while the air comes from one side everywhere: C (u^2 + theta'^2 c^2 / 12) and -C u theta' c^2 / 6."""
    moved = bare(0.7)
    moved.rate(Motion(heave_rate=-2.0, pitch_rate=np.linspace(-30.0, 30.0, LANES)), moved.z)
    u, turn, loads = moved.work.flow[:, STREAM_N], moved.work.flow[:, PITCH_RATE], moved.work.loads
    assert np.all(np.abs(turn) * CHORD / 2 < u)
    np.testing.assert_allclose(loads[:, PUSH_N], 0.7 * (u**2 + turn**2 * CHORD**2 / 12), rtol=1e-5)
    np.testing.assert_allclose(loads[:, PUSH_M], -0.7 * u * turn * CHORD**2 / 6, rtol=1e-5)


def test_it_only_takes_energy_in_still_air() -> None:
    rng = np.random.default_rng(5)
    moved = bare(0.5)
    for size in (1.0, 10.0, 100.0):
        turn, flap, heave = size * rng.normal(size=(3, LANES)) * np.array([[20.0], [3.0], [1.0]])
        forced(moved, Motion(pitch=rng.uniform(-1, 1, LANES), pitch_rate=turn, flap_rate=flap, heave_rate=heave))
        assert np.all(moved.work.air_power < 0.0)


def test_slope_is_that_of_the_normal_force() -> None:
    pushed = []
    for speed in (-3.0 - 1e-6, -3.0 + 1e-6, -3.0):
        moved = bare(0.9)
        moved.rate(Motion(heave_rate=speed), moved.z)
        pushed.append(moved.work.loads[:, PUSH_N].copy())
    np.testing.assert_allclose(moved.work.loads[:, DRAG_SLOPE], (pushed[0] - pushed[1]) / 2e-6, rtol=1e-6)
