"""A mistake in one recording of forces: the others show which it is, and which condition it must have had."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import wingfit
from wingfit.diagnosis import DiagnosisSpec
from wingfit.records import Dataset, Recording
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, campaign

COEFFICIENTS = {"C_l": 1.3, "C_r": 1.44, "C_F": 1.58}
SUSPECTS = ("airspeed_error", "body_pitch_error", "varying_coefficients", "axis_sign")
Change = Callable[[Recording], Recording]


@cache
def right() -> Dataset:
    trials = [replace(trial, coefficients=COEFFICIENTS) for trial in TRIALS[:6]]
    return campaign(5, replace(EXAMPLE, beats=12), trials, held_out=("test-2",))


def at(**condition: float) -> Change:
    return lambda one: replace(one, condition=replace(one.condition, **condition))


def mirrored(one: Recording) -> Recording:
    return at(angle_of_attack=-one.condition.angle_of_attack)(one)


def diagnosed(name: str, change: Change) -> wingfit.Finding:
    recordings = tuple(change(one) if one.name == name else one for one in right().recordings)
    return wingfit.diagnose(replace(right(), recordings=recordings), DiagnosisSpec(suspects=SUSPECTS))


@pytest.mark.parametrize(
    ("change", "label", "unit", "attribute", "factor"),
    [
        (at(airspeed=0.0), "an airspeed", "m/s", "airspeed", 1.0),
        (at(pressure=3000.0), "an air pressure", "mbar", "pressure", 0.01),
        (mirrored, "an angle of attack", "deg", "angle_of_attack", 180.0 / np.pi),
    ],
    ids=["no airspeed", "a part of the pressure", "mirrored"],
)
def test_its_true_condition_is_found(change: Change, label: str, unit: str, attribute: str, factor: float) -> None:
    found = diagnosed("test-4", change)
    truth = factor * getattr(right().recording("test-4").condition, attribute)
    assert found.verdict == "unnamed"
    assert "Without test-4 the model fits all other recordings" in found.summary
    stated = re.search(rf"it would fit with .*{label} of ([\d.e+]+) {unit} \(stated", found.summary)
    assert stated
    assert float(stated[1]) == pytest.approx(truth, rel=0.05)
    assert not any("the model misses test-4" in remark for remark in found.remarks)


def test_another_mistake_in_it_has_no_condition() -> None:
    """Forces a half too large along one axis."""
    found = diagnosed("test-4", lambda one: replace(one, values=one.values * [1.5, 1.0]))
    assert not found.named
    assert "Without test-4 the model fits all other recordings" in found.summary
    assert "what is missing shows there alone" in found.summary


def test_right_recordings_have_none() -> None:
    found = diagnosed("test-4", lambda one: one)
    assert found.verdict == "adequate"
    assert "Without" not in found.summary
