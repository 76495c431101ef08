from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import flapped, harmonic_of, phases, rigid_tracks, seen, wing_model
from wingfit.sim.effects.contract import measure
from wingfit.sim.effects.ports.observation import between
from wingfit.sim.effects.ports.stereo import Stereo

WING = wing_model().wing
SPAN, CHORD = measure(WING, "span"), measure(WING, "chord")
MIDDLE = 0.5 * (WING.stations[0].y + WING.stations[-1].y)
TURN = 2 * np.pi * 3.0
HEIGHT = 2.5 * SPAN  # of the cameras


@pytest.mark.parametrize("along_span", [0.004, -0.004, 0.02])
def test_a_marker_is_seen_by_each_camera_when_its_row_is_read_there(along_span: float) -> None:
    """Along the span its image is that of the instant at which the row of that very image is read."""
    after = seen("rolling_shutter", rigid_tracks(), along_span=along_span).beat[:1]
    place = [0.0, MIDDLE, HEIGHT, 0.4 * HEIGHT]
    cameras = Stereo(*(np.full((1, 1, 1), value) for value in place))
    for side in (-1.0, 1.0):
        image = HEIGHT * cameras.image(after, side)[1]
        psi = phases()[:, None] + TURN * along_span * image[0] / SPAN
        for k in range(0, 49, 8):
            there = flapped(0.5 * np.sin(psi[:, k]))[None, :, k, None]
            expected = HEIGHT * cameras.image(there, side)[1][0, :, 0]
            np.testing.assert_allclose(image[0, :, k], expected, atol=2e-6 if abs(along_span) < 0.01 else 3e-5)


@pytest.mark.parametrize("along_chord", [0.002, -0.01])
def test_read_along_the_chord_both_cameras_see_the_same_instant(along_chord: float) -> None:
    """The marker lies on its path, at the instant at which the row of that very position is read."""
    after = seen("rolling_shutter", rigid_tracks(), along_chord=along_chord).beat[0]
    psi = phases()[:, None] + TURN * along_chord * after[..., 0] / CHORD
    for k in range(0, 49, 8):
        np.testing.assert_allclose(after[:, k], flapped(0.5 * np.sin(psi[:, k]))[:, k], atol=2e-6)


def test_two_cameras_take_a_marker_for_too_high_by_its_speed_along_the_span() -> None:
    """By T z v / b, however far apart they are: rows of a marker at the height z differ as its images do."""
    before = rigid_tracks(0.3)
    read_out = 1e-4  # so short that a lag moves markers in proportion
    after = seen("rolling_shutter", before, along_span=read_out).beat[0]
    path = before.beat[0]
    speed = np.gradient(np.concatenate([path[-1:], path, path[:1]]), 1.0 / (len(path) * 3.0), axis=0)[1:-1]
    for k in (0, 20, 45):
        z, v, w = path[:, k, 2], speed[:, k, 1], speed[:, k, 2]
        y = path[:, k, 1] - MIDDLE
        common = read_out * y / SPAN / (1 - z / HEIGHT) * w  # by the lag that both images have
        higher = read_out * z / SPAN * (v + w * y / HEIGHT)
        within = 0.08 * np.abs(higher).max()  # the next order in z over the height of the cameras
        np.testing.assert_allclose(after[:, k, 2] - z - common, higher, atol=within)


def test_read_outwards_the_tip_is_ahead() -> None:
    """Later read means farther on: the first harmonic leads by 2 pi f tau / 2 at the tip, and lags at the root."""
    before = rigid_tracks(0.02)  # so small that rows do not change with the motion
    after = seen("rolling_shutter", before, along_span=0.01)
    for k in (0, 45):
        ratio = harmonic_of(after.beat[0, :, k, 2], 1) / harmonic_of(before.beat[0, :, k, 2], 1)
        y = WING.markers[k].position[1]
        expected = TURN * 0.01 * (y - MIDDLE) / SPAN
        assert np.angle(ratio) == pytest.approx(expected, rel=0.03)  # what lies higher is nearer the cameras
        assert abs(ratio) == pytest.approx(1.0, abs=3e-3)


def test_interpolation_is_as_good_as_stated() -> None:
    """Off by (2 pi k / n)^4 / 384 of harmonic k, half-way between steps."""
    n = 96
    for k in (1, 3, 6):
        found = between(np.sin(k * phases(n))[:, None, None])(np.full((n, 1), 0.5 / n))
        error = np.abs(found[:, 0, 0] - np.sin(k * (phases(n) + np.pi / n))).max()
        assert error == pytest.approx((2 * np.pi * k / n) ** 4 / 384, rel=0.1)


def test_a_failed_individual_stays_failed() -> None:
    before = rigid_tracks()
    before.beat[:] = np.nan
    assert np.isnan(seen("rolling_shutter", before, along_span=0.01).beat).all()
