from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.sim.effects.flown import DELFLY, FOURIER, flown
from wingfit.records import FourierPitch
from wingfit.sim.vehicle.motion import PitchError, angles_of, flap_series


def test_a_measured_pitch_is_turned_harmonic_by_harmonic() -> None:
    vehicle, pitch, lag = replace(DELFLY, motion=FOURIER), FOURIER.pitch, 0.03
    assert isinstance(pitch, FourierPitch)
    k = 2 * np.pi * lag * np.arange(1, 1 + len(pitch.cosine))
    a, b = np.array(pitch.cosine), np.array(pitch.sine)
    late = FourierPitch(pitch.mean, tuple(a * np.cos(k) - b * np.sin(k)), tuple(a * np.sin(k) + b * np.cos(k)))
    other = replace(vehicle, motion=replace(FOURIER, pitch=late))
    np.testing.assert_allclose(flown(vehicle, wing_pitch_phase__lag=lag), flown(other), atol=1e-12)


def test_a_passive_pitch_is_that_of_earlier() -> None:
    """Its value and both derivatives, by a whole number of instants."""
    motion, n, one = DELFLY.motion, 400, np.ones(1)
    series = flap_series(motion.flap, {}, 1, n)
    now, late = (
        angles_of(series, motion, {}, 12.5, n, True, 0.0, PitchError(0 * one, 0 * one, lag * one)).pitch
        for lag in (0.0, 12 / n)
    )
    scale = np.abs(now).max(axis=2, keepdims=True)
    np.testing.assert_allclose(late / scale, np.roll(now, 12, axis=2) / scale, atol=1e-7)


def test_a_delay_shows_at_the_reversals() -> None:
    change = np.abs(flown(wing_pitch_phase__lag=0.02) - flown())
    assert change.max() > 0.02
