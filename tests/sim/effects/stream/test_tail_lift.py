from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, density, flown
from tests.sim.effects.stream.test_body_drag import AREA
from tests.sim.vehicle.vehicles import recording
from wingfit.sim.vehicle.lift_drag import lift_drag


@pytest.mark.parametrize(("speed", "pitch"), [(0.0, 0.5), (0.5, 1.2), (2.0, 0.5), (4.0, -0.1)])
def test_it_is_lift_alone_and_grows_with_the_square_of_the_airspeed(speed: float, pitch: float) -> None:
    rec = recording(12.5, speed, pitch)
    more = lift_drag(flown(DELFLY, rec, tail_lift__constant=0.2, tail_lift__slope=0.5) - flown(DELFLY, rec), pitch)
    lift = (0.2 + 0.5 * np.sin(pitch)) * AREA * 0.5 * density(rec) * speed**2
    np.testing.assert_allclose(more, np.broadcast_to([lift, 0.0], more.shape), atol=1e-6 * abs(lift) + 1e-15)
