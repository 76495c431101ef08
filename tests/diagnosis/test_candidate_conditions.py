"""Conditions that are compared as the next experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from wingfit.diagnosis.candidate_conditions import (
    MAX_BETWEEN,
    MAX_BEYOND,
    SLOWER,
    TILT,
    WIND,
    candidate_conditions,
    settings_beyond,
)
from wingfit.records import Condition, Recording, RigLimits
from wingfit.sim.virtual_rigs.balance import TRIALS
from wingfit.sim.virtual_rigs.balance import blank_recording as blank_forces
from wingfit.sim.virtual_rigs.campaign import SMALL, blank_recording, name_of, robird_wing, vacuum

WING = tuple(blank_recording(robird_wing(), c, name_of(c), frames=40) for c, _ in SMALL)
VEHICLE = tuple(blank_forces(trial.condition, trial.name, 64) for trial in TRIALS)


def range_of(conditions: Sequence[Condition], name: str) -> tuple[float, float]:
    values = [getattr(one, name) for one in conditions]
    return min(values), max(values)


@pytest.mark.parametrize("recordings", [WING, VEHICLE], ids=["wing", "vehicle"])
def test_the_first_are_between_the_recorded_and_the_others_a_little_beyond(recordings: Sequence[Recording]) -> None:
    recorded, found = [one.condition for one in recordings], candidate_conditions(recordings)
    beyond = [settings_beyond(one, recorded) for one in found]
    first = beyond.index(next(one for one in beyond if one))
    assert not set(found) & set(recorded)
    assert len(set(found)) == len(found)
    assert 3 < first <= MAX_BETWEEN
    assert all(beyond[first:])
    assert 3 < len(found) - first <= MAX_BEYOND
    slow, fast = range_of(recorded, "flap_frequency")
    least, most = range_of([one for one in recorded if one.airspeed > 0], "airspeed")
    low, high = range_of([one for one in recorded if one.airspeed > 0], "angle_of_attack")
    assert min(one.flap_frequency for one in found) == pytest.approx(SLOWER * slow)
    assert max(one.flap_frequency for one in found) <= fast, "a faster beat could break a wing"
    blown = [one for one in found if one.airspeed > 0]
    assert range_of(blown, "airspeed") == pytest.approx((WIND[0] * least, WIND[1] * most))
    assert range_of(blown, "angle_of_attack") == pytest.approx((low - TILT, min(high + TILT, np.pi / 2)))
    assert range_of([*found, *recorded], "phase_lag") == range_of(recorded, "phase_lag")


def test_a_chamber_is_opened_where_it_was_not_recorded_in_air() -> None:
    """And the pressures of a chamber are not combined with the tunnel."""
    still = [one for one in WING if one.condition.airspeed == 0]
    thin = [replace(one, condition=replace(one.condition, pressure=1000.0)) for one in still]
    assert {one.pressure for one in candidate_conditions(thin)} == {1000.0, 101_325.0}
    tunnel = {one.condition.pressure for one in WING if one.condition.airspeed > 0}
    assert {one.pressure for one in candidate_conditions(WING) if one.airspeed > 0} == tunnel


def test_settings_beyond_the_recorded_are_named() -> None:
    recorded = [vacuum(0.0, 0.0, 3.0), replace(vacuum(0.0, 0.0, 4.0), pressure=2e4)]
    assert settings_beyond(recorded[0], recorded) == ()
    assert settings_beyond(replace(recorded[0], flap_frequency=2.0, pressure=1e5), recorded) == (
        "flap frequency",
        "pressure",
    )


def test_jittering_settings_count_as_one() -> None:
    """Measured frequencies that scatter about a setting are one setting."""
    rng = np.random.default_rng(1)
    shaken = [
        replace(r, condition=replace(r.condition, flap_frequency=r.condition.flap_frequency + rng.normal(0, 0.005)))
        for r in WING
    ]
    few = 2 * (5 + 1)  # three, the middles between them, and a slower one, in either rig
    assert len({c.flap_frequency for c in candidate_conditions(shaken)}) <= few


def test_none_is_proposed_in_free_flight() -> None:
    assert candidate_conditions([replace(one, rig="free_flight") for one in VEHICLE]) == ()


def test_nothing_is_proposed_beyond_the_stated_limits() -> None:
    """And a setting with limits is proposed up to them, also where a rig without limits would not go."""
    pitch = (np.radians(20.0), np.radians(80.0))
    limits = RigLimits(flap_frequency=(9.0, 14.5), airspeed=(0.3, 1.0), angle_of_attack=pitch)
    found = candidate_conditions(VEHICLE, limits)
    assert all(limits.allow(one) for one in found)
    assert range_of(found, "flap_frequency") == pytest.approx((9.0, 14.5))
    assert range_of([one for one in found if one.airspeed > 0], "angle_of_attack") == pytest.approx(pitch)
    assert max(one.airspeed for one in found) == pytest.approx(1.0)
    assert not all(limits.allow(one) for one in candidate_conditions(VEHICLE))


def test_limits_hold_their_ends_and_what_is_not_stated_is_free() -> None:
    limits = RigLimits(pressure=(1e3, 1e5))
    inside = vacuum(0.0, 0.0, 3.0)
    assert limits.allow(replace(inside, pressure=1e5))
    assert limits.allow(replace(inside, pressure=1e3, flap_frequency=900.0))
    assert not limits.allow(replace(inside, pressure=1.01e5))
