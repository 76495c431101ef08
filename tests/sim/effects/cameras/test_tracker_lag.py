from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import Array, harmonic_of, rigid_tracks, seen
from wingfit.sim.effects.library.cameras.tracker_lag import apparent_step, response, steady_gains

F = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
NOISE = np.array([0.5, 1.0, 1.0])  # of a change of the acceleration, on position, velocity and acceleration


def kalman(measured: Array, smoothing: float) -> tuple[Array, Array]:
    """Filtered positions [T] and last gain [3] of a Kalman filter of constant acceleration, frame by frame."""
    state, P = np.zeros(3), 1e6 * np.eye(3)
    Q, R = np.outer(NOISE, NOISE), smoothing**2
    positions, gain = [], np.zeros(3)
    for z in measured:
        state, P = F @ state, F @ P @ F.T + Q
        gain = P[:, 0] / (P[0, 0] + R)
        state = state + gain * (z - state[0])
        keep = np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])
        P = keep @ P @ keep.T + R * np.outer(gain, gain)
        positions.append(state[0])
    return np.array(positions), gain


@pytest.mark.parametrize("smoothing", [1e-3, 0.3, 2.0, 20.0, 100.0])
def test_gains_are_those_a_kalman_filter_settles_at(smoothing: float) -> None:
    _, gain = kalman(np.zeros(600), smoothing)
    np.testing.assert_allclose(np.concatenate(steady_gains(np.array([smoothing]))), gain, rtol=1e-6)


@pytest.mark.parametrize("smoothing", [0.3, 2.0, 20.0])
@pytest.mark.parametrize("angle", [2 * np.pi / 31, -2 * np.pi / 31, -6 * np.pi / 31, 1.7])
def test_response_is_that_of_a_filter_run_on_a_sine(smoothing: float, angle: float) -> None:
    """Amplitude and phase of a tracker that runs frame by frame until it has settled."""
    frames = np.arange(1200)
    out, _ = kalman(np.cos(angle * frames), smoothing)
    late = frames[600:]
    basis = np.stack([np.cos(angle * late), -np.sin(angle * late)], axis=1)
    real, imaginary = np.linalg.lstsq(basis, out[600:], rcond=None)[0]
    found = response(np.array([smoothing]), np.array([angle]))[0, 0]
    assert found == pytest.approx(complex(real, imaginary), abs=1e-6)


def test_the_mean_and_a_slow_motion_pass() -> None:
    found = response(np.array([5.0]), np.array([0.0, 1e-3]))[0]
    assert found[0] == 1.0
    assert abs(found[1] - 1) < 1e-6


def test_apparent_step_of_the_thesis_is_backwards() -> None:
    """3.1 Hz on 3 Hz: each flash is 1/31 of a beat earlier in phase; at 2.9 Hz 1/29 later; film at 60 Hz 1/20."""
    times = np.arange(50)
    assert apparent_step(times / 3.1, 3.0) == pytest.approx(-2 * np.pi / 31)
    assert apparent_step(times / 2.9, 3.0) == pytest.approx(2 * np.pi / 29)
    assert apparent_step(times / 60.0, 3.0) == pytest.approx(2 * np.pi / 20)


def test_each_harmonic_of_the_tracks_passes_the_filter() -> None:
    """Lag in the order of frames that go backwards is a lead in the beat."""
    before = rigid_tracks()
    after = seen("tracker_lag", before, smoothing=5.0)
    for order in (0, 1, 3):
        a, b = (harmonic_of(s.beat[0, :, 48, 2], order) for s in (before, after))
        expected = response(np.array([5.0]), np.array([-2 * np.pi / 31 * order]))[0, 0]
        assert b == pytest.approx(a * expected, abs=1e-12)
    assert np.angle(response(np.array([5.0]), np.array([0.7])))[0, 0] < -0.05
