"""A stream that is faster than recorded equals a condition with that airspeed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.rigs import Array, force_recording, recordings, vehicle_model, wing_model
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.wing.flexible_wing import FlexibleWing


def own(model: FlexibleWing | BladeElementWing) -> Array:
    """Nominal genome."""
    return np.array([gene.nominal for gene in model.genes])


def flown(airspeed_factor: float, *, part: float | None = None) -> Array:
    """Forces of the vehicle."""
    model, recording = vehicle_model(), force_recording()
    recording = replace(
        recording,
        condition=replace(recording.condition, airspeed=recording.condition.airspeed * airspeed_factor),
    )
    if part is None:
        return np.asarray(model.observe(own(model)[None], recording).channels[0])
    found = model.with_effects("airspeed_error").observe(np.array([[*own(model), part]]), recording)
    return np.asarray(found.channels[0])


def driven(airspeed_factor: float, *, part: float | None = None) -> Array:
    """Tracks of the wing over a beat."""
    model, recording = wing_model(), recordings("wing")["air"]
    recording = replace(
        recording,
        condition=replace(recording.condition, airspeed=recording.condition.airspeed * airspeed_factor),
    )
    if part is None:
        return np.asarray(model.beat(own(model), recording).tracks)
    return np.asarray(model.with_effects("airspeed_error").beat([*own(model), part], recording).tracks)


@pytest.mark.parametrize("part", [-0.3, 0.1])
def test_it_is_the_airspeed_times_one_and_the_part(part: float) -> None:
    np.testing.assert_allclose(driven(1.0, part=part), driven(1.0 + part), atol=1e-12)
    np.testing.assert_allclose(flown(1.0, part=part), flown(1.0 + part), atol=1e-12)
    assert np.abs(driven(1.0, part=part) - driven(1.0)).max() > 1e-4


def test_without_a_stream_there_is_none() -> None:
    np.testing.assert_array_equal(driven(0.0, part=0.3), driven(0.0))
    np.testing.assert_array_equal(flown(0.0, part=0.3), flown(0.0))


def test_a_condition_in_whole_numbers_is_a_condition() -> None:
    model, recording = vehicle_model().with_effects("airspeed_error"), force_recording()
    genome = np.array([[*own(vehicle_model()), 0.1]])
    whole, same = (
        replace(recording, condition=replace(recording.condition, airspeed=speed, flap_frequency=frequency))
        for speed, frequency in ((2, 12), (2.0, 12.0))
    )
    assert isinstance(whole.condition.airspeed, float)
    found, expected = (model.observe(genome, one).channels for one in (whole, same))
    np.testing.assert_array_equal(found, expected)
