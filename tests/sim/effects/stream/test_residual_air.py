"""Air that is denser than recorded equals a condition with a higher pressure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.rigs import Array, force_recording, recordings, vehicle_model, wing_model
from wingfit.records import Recording
from wingfit.sim.atmosphere import density
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.wing.flexible_wing import FlexibleWing


def own(model: FlexibleWing | BladeElementWing) -> Array:
    """Nominal genome."""
    return np.array([gene.nominal for gene in model.genes])


def at(recording: Recording, more: float) -> Recording:
    """The recording under the pressure that makes its air denser by ``more`` (kg/m^3)."""
    here = recording.condition
    factor = 1.0 + more / density(here.pressure, here.temperature)
    return replace(recording, condition=replace(here, pressure=here.pressure * factor))


def tracks(recording: Recording, more: float) -> Array:
    model = wing_model().with_effects("residual_air")
    return np.asarray(model.beat([*own(wing_model()), more], recording).tracks)


@pytest.mark.parametrize("where", ["air", "vacuum"])
@pytest.mark.parametrize("more", [0.02, -0.005])
def test_a_wing_feels_the_pressure_that_it_means(where: str, more: float) -> None:
    recording = recordings("wing")[where]
    expected = wing_model().beat(own(wing_model()), at(recording, more)).tracks
    np.testing.assert_allclose(tracks(recording, more), expected, atol=1e-12)


def test_a_vehicle_does_too() -> None:
    model, recording = vehicle_model(), force_recording()
    found = model.with_effects("residual_air").observe(np.array([[*own(model), 0.05]]), recording).channels
    np.testing.assert_allclose(found, model.observe(own(model)[None], at(recording, 0.05)).channels, atol=1e-12)


def test_there_is_never_less_than_none() -> None:
    """In 0.012 kg/m^3, a hundredth less and a tenth less: the latter is a perfect vacuum."""
    recording = recordings("wing")["vacuum"]
    none = replace(recording, condition=replace(recording.condition, pressure=1e-9))
    np.testing.assert_allclose(tracks(recording, -0.1), wing_model().beat(own(wing_model()), none).tracks, atol=1e-9)
