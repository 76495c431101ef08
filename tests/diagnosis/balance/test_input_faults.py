"""What users get wrong about a balance, in recordings that are right otherwise: each is named, not physics."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import wingfit
from wingfit.records import Dataset, Recording
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, campaign

COEFFICIENTS = {"C_l": 1.3, "C_r": 1.44, "C_F": 1.58}  # the same in all conditions
POUND = 4.4482216  # N
Change = Callable[[Recording], Recording]


@cache
def right() -> Dataset:
    trials = [replace(trial, coefficients=COEFFICIENTS) for trial in TRIALS[1::2]]
    return campaign(5, replace(EXAMPLE, beats=12), trials, held_out=("test-4",))


def pitched(factor: float) -> Change:
    def change(one: Recording) -> Recording:
        return replace(one, condition=replace(one.condition, angle_of_attack=factor * one.condition.angle_of_attack))

    return change


def late(one: Recording) -> Recording:
    """Time counts from a quarter of a beat before its start."""
    return replace(one, times=one.times + 0.25 / one.condition.flap_frequency)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda one: replace(one, values=one.values * [-1.0, 1.0]), {"axis_sign"}),
        (lambda one: replace(one, values=one.values[:, ::-1].copy()), {"axis_swap"}),
        (lambda one: replace(one, values=one.values / POUND), {"unit_error"}),
        (late, {"phase_reference"}),
        (pitched(math.pi / 180), {"body_pitch_convention"}),
        # with the same wings above and below, nothing distinguishes these two
        (pitched(-1.0), {"axis_sign", "body_pitch_convention"}),
        # nor these, since free coefficients absorb what all forces have in common
        (lambda one: replace(one, values=2.0 * one.values), {"scale_error", "added_mass_error", "residual_air"}),
    ],
    ids=["sign", "swap", "pounds", "phase", "degrees", "mirror", "twice"],
)
def test_a_fault_of_the_input_is_named(change: Change, expected: set[str]) -> None:
    wrong = replace(right(), recordings=tuple(change(one) for one in right().recordings))
    found = wingfit.diagnose(wrong)
    assert set(found.named) == expected
    assert (found.verdict == "ambiguous") == (len(expected) > 1)
    assert found.proof is not None
    assert found.proof.improved


def test_right_input_has_no_fault() -> None:
    found = wingfit.diagnose(right())
    assert found.verdict == "adequate"
    assert np.isclose(sum(found.probabilities.values()), 1.0)
