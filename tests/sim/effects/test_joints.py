from __future__ import annotations

import numpy as np
import pytest

from tests.sim.kernels.marching import CHORD, LENGTH, plank
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import build


@pytest.mark.parametrize(("strips", "pieces"), [(4, 1), (5, 3)])
def test_where_connectors_lie_and_how_much_wing_each_stands_for(strips: int, pieces: int) -> None:
    """From centre to centre: strips along the span (half of one at the root), pieces along the chord."""
    structure = build(plank(), Division.parse(f"{strips}x{pieces}"))
    joints = Joints.of(structure)
    for k, connector in enumerate(structure.connectors):
        strip = connector.second // pieces
        if connector.first < 0:
            along, part, reach = True, 0.5 / strips, (0.0, 0.5 / strips)
        elif connector.second - connector.first == pieces:
            along, part, reach = True, 1 / strips, ((strip - 0.5) / strips, (strip + 0.5) / strips)
        else:
            along, part, reach = False, CHORD / pieces / LENGTH, (strip / strips, (strip + 1) / strips)
        assert joints.along_span[k] == along
        assert joints.part[k] == pytest.approx(part, rel=1e-3)  # its rods and its marker weigh a little
        assert joints.reach[k] == pytest.approx(reach, abs=1e-3)


def test_bending_is_about_the_axis_that_is_not_twisted_and_not_of_the_root() -> None:
    structure = build(plank(), Division.parse("4x2"))
    joints, stiffness = Joints.of(structure), np.random.default_rng(1).uniform(1, 2, (len(structure.connectors), 6, 8))
    about_x, about_y = joints.bending(stiffness)
    bends = joints.along_span & [c.first >= 0 for c in structure.connectors]
    np.testing.assert_array_equal(about_x, np.where(bends[:, None], stiffness[:, 0], 0))
    np.testing.assert_array_equal(about_y, np.where(joints.along_span[:, None], 0, stiffness[:, 1]))
