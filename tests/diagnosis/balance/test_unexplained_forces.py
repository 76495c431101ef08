"""Forces that no effect explains: each suspect is fitted by itself, whatever its score test predicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import wingfit
from wingfit.diagnosis import DiagnosisSpec
from wingfit.records import Recording
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, campaign

COEFFICIENTS = {"C_l": 1.3, "C_r": 1.44, "C_F": 1.58}
SUSPECTS = ("clock_offset", "balance_offset", "stroke_bias", "scale_error", "tail_lift")


def rippled(one: Recording, sign: float) -> Recording:
    """Add a force (N) at twice the flap frequency; no effect has a sign that changes from recording to recording."""
    phase = 2.0 * np.pi * one.condition.flap_frequency * one.times
    return replace(one, values=one.values + 0.03 * sign * np.sin(2.0 * phase)[:, None])


def test_each_suspect_and_pairs_with_the_best_are_fitted_where_none_explains_the_forces() -> None:
    trials = [replace(trial, coefficients=COEFFICIENTS) for trial in TRIALS[1::2]]
    right = campaign(5, replace(EXAMPLE, beats=12), trials, held_out=("test-4",))
    recordings = tuple(rippled(one, (-1.0) ** k) for k, one in enumerate(right.recordings))
    found = wingfit.diagnose(replace(right, recordings=recordings), DiagnosisSpec(suspects=SUSPECTS))
    fitted = [one.effects for one in found.hypotheses if one.refitted]
    assert found.verdict == "unnamed"
    assert {(name,) for name in SUSPECTS} <= set(map(tuple, fitted))
    assert sum(len(one) == 2 for one in fitted) >= len(SUSPECTS) - 1
