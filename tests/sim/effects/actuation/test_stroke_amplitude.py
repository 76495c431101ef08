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


@pytest.mark.parametrize(("linkage", "length", "angle"), [(1.0, np.tan, np.arctan), (-0.5, np.sin, np.arcsin)])
def test_a_longer_lever_or_crank_makes_the_stroke_larger(linkage: float, length: np.ufunc, angle: np.ufunc) -> None:
    """The tangent or the sine of the stroke grows by a small part; to third order in the stroke, so does the law's."""
    part, psi = 1e-3, 2 * np.pi * np.arange(64) / 64
    described, larger = (
        scene_of("stroke_amplitude", robird(), part=size, linkage=linkage).rods.angles(psi)[:, :, 0, 0]
        for size in (0.0, part)
    )
    stroke = described - described.mean(axis=0)
    change = angle((1 + part) * length(stroke)) - stroke
    assert abs(larger - described - change).max() < 0.15 * abs(part * stroke - change).max()


@pytest.mark.parametrize("linkage", [-0.5, 1.0])
def test_linkage_does_nothing_to_a_stroke_as_described(linkage: float) -> None:
    with_, without = (scene_of("stroke_amplitude", robird(), part=0.0, linkage=x).rods.series for x in (linkage, 0.0))
    np.testing.assert_array_equal(with_, without)


@pytest.mark.parametrize("end", [-0.3, 0.3])
def test_the_work_of_the_motors_closes_the_ledger(end: float) -> None:
    assert ledger(beat_of("stroke_amplitude", AIR, 96, part=end), AIR.flap_frequency) < 1e-4
