from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.sim.effects.flown import DELFLY, FOURIER, flown
from wingfit.records import FourierPitch, PassivePitch


def test_a_passive_wing_yields_more_by_the_same_law() -> None:
    """All coefficients of Eq. 17 but the constant grow."""
    p = DELFLY.motion.pitch
    assert isinstance(p, PassivePitch)
    more = PassivePitch(p.constant, 1.2 * p.flap, 1.2 * p.flap_rate, 1.2 * p.flap_rate_squared)
    other = replace(DELFLY, motion=replace(DELFLY.motion, pitch=more))
    np.testing.assert_allclose(flown(wing_pitch_amplitude__part=0.2), flown(other), atol=1e-12)


def test_of_a_measured_pitch_the_deviation_from_the_mean_grows() -> None:
    vehicle, pitch = replace(DELFLY, motion=FOURIER), FOURIER.pitch
    assert isinstance(pitch, FourierPitch)
    less = replace(pitch, cosine=tuple(0.7 * c for c in pitch.cosine), sine=tuple(0.7 * s for s in pitch.sine))
    other = replace(vehicle, motion=replace(FOURIER, pitch=less))
    np.testing.assert_allclose(flown(vehicle, wing_pitch_amplitude__part=-0.3), flown(other), atol=1e-12)
