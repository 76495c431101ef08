"""A stroke that is larger than described."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.bench import AIR, beat_of, ledger, scene_of
from tests.sim.effects.driving import SLOW, robird, stiff_tracks, turned

X = np.array([1.0, 0.0, 0.0])


@pytest.mark.parametrize("part", [-0.3, 0.05, 0.3])
def test_all_harmonics_grow_and_the_mean_does_not(part: float) -> None:
    nominal, larger = (scene_of("stroke_amplitude", robird(), part=p).rods.series for p in (0.0, part))
    np.testing.assert_allclose(larger[1:], nominal[1:] * (1 + part), rtol=1e-14)
    np.testing.assert_array_equal(larger[0], nominal[0])


def test_a_stiff_wing_swings_so_much_further() -> None:
    tracks = stiff_tracks("stroke_amplitude", part=0.2)
    psi = 2 * np.pi * np.arange(len(tracks)) / len(tracks)
    flap = scene_of("stroke_amplitude", robird(), SLOW, part=0.0).rods.angles(psi)[:, 0, 0, 0]
    wider = flap.mean() + 1.2 * (flap - flap.mean())
    np.testing.assert_allclose(tracks, turned(robird(), wider, X, np.zeros(3)), atol=1e-4)


@pytest.mark.parametrize("end", [-0.3, 0.3])
def test_the_work_of_the_motors_closes_the_ledger(end: float) -> None:
    assert ledger(beat_of("stroke_amplitude", AIR, 96, part=end), AIR.flap_frequency) < 1e-4
