from __future__ import annotations

import numpy as np
import pytest

from sim.effects.contract import measure
from sim.effects.observation import between
from tests.sim.effects.rigs import flapped, harmonic_of, phases, rigid_tracks, seen, wing_model

WING = wing_model().wing
SPAN, CHORD = measure(WING, "span"), measure(WING, "chord")
MIDDLE = 0.5 * (WING.stations[0].y + WING.stations[-1].y)
TURN = 2 * np.pi * 3.0


@pytest.mark.parametrize(("along_span", "along_chord"), [(0.004, 0.0), (-0.004, 0.002), (0.02, 0.01)])
def test_a_marker_is_seen_when_its_row_is_read(along_span: float, along_chord: float) -> None:
    """What is seen lies on the path at the instant at which the row of that very position is read."""
    after = seen("rolling_shutter", rigid_tracks(), along_span=along_span, along_chord=along_chord).beat[0]
    late = along_span * (after[..., 1] - MIDDLE) / SPAN + along_chord * after[..., 0] / CHORD
    psi = phases()[:, None] + TURN * late
    for k in range(0, 49, 8):
        expected = flapped(0.5 * np.sin(psi[:, k]))[:, k]
        np.testing.assert_allclose(after[:, k], expected, atol=2e-6 if along_span < 0.01 else 2e-5)


def test_read_outwards_the_tip_is_ahead() -> None:
    """Later read means farther on: the first harmonic leads by 2 pi f tau / 2 at the tip, and lags at the root."""
    before = rigid_tracks(0.02)  # so small that rows do not change with the motion
    after = seen("rolling_shutter", before, along_span=0.01)
    for k in (0, 45):
        ratio = harmonic_of(after.beat[0, :, k, 2], 1) / harmonic_of(before.beat[0, :, k, 2], 1)
        y = WING.markers[k].position[1]
        assert np.angle(ratio) == pytest.approx(TURN * 0.01 * (y - MIDDLE) / SPAN, abs=1e-4)
        assert abs(ratio) == pytest.approx(1.0, abs=1e-4)


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
