"""Forces that hold less than usual: one axis, or few samples in a beat."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Literal

import pytest

import wingfit
from wingfit.diagnosis import Finding
from wingfit.records import Dataset, Recording
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, campaign

COEFFICIENTS = {"C_l": 1.3, "C_r": 1.44, "C_F": 1.58, "C_D0": 0.2, "C_Dpi2": 3.6}
"""The same in all conditions; the drag is not that of the defaults."""


@cache
def recorded() -> Dataset:
    trials = [replace(trial, coefficients=COEFFICIENTS) for trial in TRIALS[1::2]]
    return campaign(5, replace(EXAMPLE, beats=12), trials, held_out=("test-4",))


def along(axis: Literal["x", "z"]) -> Dataset:
    def only(one: Recording) -> Recording:
        return replace(one, forces=(axis,), values=one.values[:, [one.forces.index(axis)]])

    return replace(recorded(), recordings=tuple(only(one) for one in recorded().recordings))


def every(step: int) -> Finding:
    coarse = tuple(replace(one, times=one.times[::step], values=one.values[::step]) for one in recorded().recordings)
    return wingfit.diagnose(replace(recorded(), recordings=coarse))


@pytest.mark.parametrize("axis", ["x", "z"])
def test_another_drag_than_the_default_is_no_missing_physics_of_forces_along_one_axis(axis: Literal["x", "z"]) -> None:
    found = wingfit.diagnose(along(axis))
    assert found.verdict == "adequate"
    assert found.proof is not None
    assert found.proof.after.value == pytest.approx(1.0, abs=0.2)


def test_few_samples_in_a_beat_are_remarked_on() -> None:
    fastest = max(one.condition.flap_frequency for one in recorded().recordings)
    for step, few in ((7, False), (13, True)):
        assert (1250.0 / step / fastest < 12.0) == few
        remarks = [one for one in every(step).remarks if "few samples in a beat" in one]
        assert bool(remarks) == few
    assert "test-2 (" in remarks[0]
