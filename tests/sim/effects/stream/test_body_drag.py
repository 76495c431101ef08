from __future__ import annotations

import math

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, density, flown
from tests.sim.vehicle.vehicles import recording
from wingfit.sim.vehicle.lift_drag import lift_drag

AREA = 0.137 * (0.085 + 2 * 0.0835 + 0.056) / 4  # of one wing, by trapezia


@pytest.mark.parametrize(("speed", "pitch"), [(0.0, 0.5), (0.5, 1.2), (2.0, 0.5), (4.0, -0.1)])
def test_it_is_drag_alone_and_grows_with_the_square_of_the_airspeed(speed: float, pitch: float) -> None:
    rec = recording(12.5, speed, pitch)
    more = lift_drag(flown(DELFLY, rec, body_drag__area=0.4) - flown(DELFLY, rec), pitch)
    drag = 0.4 * AREA * 0.5 * density(rec) * speed**2
    np.testing.assert_allclose(more, np.broadcast_to([0.0, drag], more.shape), atol=1e-6 * drag + 1e-15)


def test_it_meets_the_air_that_there_is() -> None:
    """A faster stream of denser air, by other effects, drags more."""
    rec = recording(12.5, 2.0, math.radians(30))
    before = flown(DELFLY, rec, airspeed_error__part=0.1, residual_air__density=0.05)
    after = flown(DELFLY, rec, airspeed_error__part=0.1, residual_air__density=0.05, body_drag__area=0.4)
    drag = 0.4 * AREA * 0.5 * (density(rec) + 0.05) * 2.2**2
    np.testing.assert_allclose(np.hypot(*(after - before).T), drag, rtol=1e-5)


@pytest.mark.parametrize("pitch", [0.0, 0.4, math.pi / 4, 1.4, math.pi / 2, -0.3])
def test_components_of_the_stream_act_independently_on_a_slender_body(pitch: float) -> None:
    """Axial drag and cross-flow (Allen and Perkins 1951), each by the square of its component."""
    rec = recording(12.5, 2.0, pitch)
    more = flown(DELFLY, rec, body_drag__area=0.4, body_drag__slender=1.0) - flown(DELFLY, rec)
    along, across = 2.0 * math.cos(pitch), 2.0 * math.sin(pitch)
    force = -0.4 * AREA * 0.5 * density(rec) * np.array([along * abs(along), across * abs(across)])
    np.testing.assert_allclose(more, np.broadcast_to(force, more.shape), atol=2e-6 * np.abs(force).max())


def test_a_slender_body_takes_power_from_the_stream() -> None:
    """The force is against the stream, and smaller than on a bluff body, by 1 - 2^-1/2 at 45 degrees."""
    rec = recording(12.5, 2.0, math.pi / 4)
    plain = flown(DELFLY, rec)
    bluff, half, slender = (
        lift_drag(flown(DELFLY, rec, body_drag__area=0.4, body_drag__slender=s) - plain, math.pi / 4)[:, 1]
        for s in (0.0, 0.5, 1.0)
    )
    np.testing.assert_allclose(slender / bluff, math.sqrt(0.5), rtol=1e-5)
    np.testing.assert_allclose(half, 0.5 * (bluff + slender), rtol=1e-5)
