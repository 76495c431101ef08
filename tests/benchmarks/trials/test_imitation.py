"""The benchmark of imitations: what it hides, how strongly, and how it counts a verdict."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.imitation import (
    ABSORBED,
    NOISE,
    Plan,
    _change,
    _judged,
    _sized,
    hideable,
    planned,
    recorded,
)
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS


def test_kinds_take_turns_and_plans_are_reproducible() -> None:
    plans = [planned(7, k) for k in range(6)]
    assert [plan.kind for plan in plans] == ["alone", "beside", "omitted"] * 2
    assert plans == [planned(7, k) for k in range(6)]
    assert [len(plan.hidden) for plan in plans[:3]] == [1, 2, 1]
    assert plans[0].removed == ()
    assert plans[1].removed == (plans[1].hidden[1][0],)
    assert plans[2].removed == (plans[2].hidden[0][0],)


def test_choices_are_not_hidden() -> None:
    names = hideable()
    assert {"body_drag", "balance_tilt", "wing_pitch_phase"} <= set(names)
    assert not {"axis_sign", "unit_error", "clap_and_peel"} & set(names)


@pytest.mark.parametrize("name", ["body_drag", "stroke_amplitude", "balance_tilt", "dynamic_stall"])
def test_an_effect_is_as_strong_as_intended(name: str) -> None:
    values = _sized(EFFECTS[name], 2.0, np.random.default_rng(1))
    assert _change(EFFECTS[name], values) == pytest.approx(ABSORBED * 2.0 * NOISE, rel=0.4)


def test_recordings_have_the_hidden_effects() -> None:
    plan = Plan(3, "beside", (("body_drag", 3.0), ("balance_offset", 3.0)), ("balance_offset",))
    found, nothing = recorded(7, plan), recorded(7, Plan(3, "beside", (), ()))
    assert [one.name for one in found.recordings] == [trial.name for trial in TRIALS]
    change = [one.values - other.values for one, other in zip(found.recordings, nothing.recordings, strict=True)]
    assert all(np.abs(each).max() > 2 * 10.0**-EXAMPLE.decimals for each in change)


@pytest.mark.parametrize(
    ("named", "expected"),
    [
        (("body_drag",), (True, False, False)),
        (("stroke_bias",), (False, True, False)),
        (("body_drag", "stroke_bias"), (False, True, False)),
        (("balance_drift",), (False, False, True)),
    ],
)
def test_right_wrong_and_similar(named: tuple[str, ...], expected: tuple[bool, bool, bool]) -> None:
    """An effect that is known to look like the removed one is similar."""
    plan = Plan(0, "beside", (("body_drag", 3.0), ("balance_offset", 1.0)), ("balance_offset",))
    finding: Any = SimpleNamespace(verdict="named", named=named, hypotheses=())
    row = _judged(finding, plan)
    assert (row["right"], row["wrong"], row["similar"]) == expected
