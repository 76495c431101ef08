from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.sim.effects.flown import DELFLY, FOURIER, flown
from wingfit.records import FourierPitch, PassivePitch


def test_it_is_a_pitch_with_another_constant() -> None:
    pitch = DELFLY.motion.pitch
    assert isinstance(pitch, PassivePitch)
    other = replace(DELFLY, motion=replace(DELFLY.motion, pitch=replace(pitch, constant=pitch.constant + 0.07)))
    np.testing.assert_allclose(flown(wing_pitch_zero__angle=0.07), flown(other), atol=1e-13)


def test_also_where_the_pitch_was_measured() -> None:
    vehicle, pitch = replace(DELFLY, motion=FOURIER), FOURIER.pitch
    assert isinstance(pitch, FourierPitch)
    other = replace(vehicle, motion=replace(FOURIER, pitch=replace(pitch, mean=pitch.mean - 0.05)))
    np.testing.assert_allclose(flown(vehicle, wing_pitch_zero__angle=-0.05), flown(other), atol=1e-13)
