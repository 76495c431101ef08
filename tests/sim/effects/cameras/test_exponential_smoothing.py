from __future__ import annotations

import numpy as np
import pytest
import scipy

from tests.sim.effects.rigs import rigid_tracks, seen
from wingfit.sim.effects.library.cameras.exponential_smoothing import response
from wingfit.sim.effects.library.cameras.tracker_lag import apparent_step


@pytest.mark.parametrize("weight", [0.1, 0.45, 0.9])
@pytest.mark.parametrize("angle", [2 * np.pi / 31, -2 * np.pi / 31, 1.7])
def test_response_is_that_of_the_recursion_on_a_sine(weight: float, angle: float) -> None:
    frames = np.arange(800)
    wave = np.cos(angle * frames)
    out = scipy.signal.lfilter([1.0 - weight], [1.0, -weight], wave)
    late = frames[400:]
    basis = np.stack([np.cos(angle * late), -np.sin(angle * late)], axis=1)
    real, imaginary = np.linalg.lstsq(basis, out[400:], rcond=None)[0]
    assert response(np.array([weight]), np.array([angle]))[0, 0] == pytest.approx(complex(real, imaginary), abs=1e-9)


def test_a_flapping_wing_is_smaller_and_its_mean_stays() -> None:
    before = rigid_tracks()
    after = seen("exponential_smoothing", before, weight=0.45)
    np.testing.assert_allclose(after.beat.mean(axis=1), before.beat.mean(axis=1), atol=1e-12)
    step = apparent_step(before.recording.times, before.recording.condition.flap_frequency)
    gain = abs(response(np.array([0.45]), np.array([step]))[0, 0])
    height = [abs(np.fft.rfft(beat[0, :, -1, 2])[1]) for beat in (before.beat, after.beat)]
    assert height[1] / height[0] == pytest.approx(gain, rel=1e-9)
    assert gain < 1.0
