"""The example of a controller that holds the lift of an exported vehicle."""

from __future__ import annotations

import pytest

from tests.oracles.exports.fmus import Fmu


def test_the_controller_holds_the_lift_through_a_change_of_airspeed(vehicle_fmu: Fmu) -> None:
    control = pytest.importorskip("examples.fmu.control", reason="FMPy is not installed: pip install 'wingfit[fmu]'")
    beats = control.controlled(str(vehicle_fmu.path), 0.12, 3.0, 0.5)
    before, after = [one for one in beats if 1.0 < one[0] < 1.5], [one for one in beats if one[0] > 2.5]
    assert beats[0][2] != pytest.approx(0.12, rel=0.03)
    for part in (before, after):
        assert [lift for _, _, lift in part] == pytest.approx([0.12] * len(part), rel=0.01)
    assert abs(after[-1][1] - before[-1][1]) > 0.05  # Hz: the other airspeed needs another frequency
