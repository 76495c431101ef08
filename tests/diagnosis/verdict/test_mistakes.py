"""Likely mistakes of a dataset and the effects that describe them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast, get_args

import pytest

from wingfit.checks import CHECKS
from wingfit.checks.mistake import EVERY, Kind, Mistake
from wingfit.diagnosis.finding import VERDICTS, Verdict, of_the_library
from wingfit.diagnosis.verdict.mistakes import DESCRIBED_BY, MistakeDoubt
from wingfit.diagnosis.verdict.verdict import Decision
from wingfit.records.mistake_kinds import MistakeKind
from wingfit.sim.effects.registry import EFFECTS

CAUSE = "may be the cause: correct the dataset"


def decision(verdict: Verdict, *named: str, share: float = 0.99) -> Decision:
    shares: dict[str, float] = dict.fromkeys(VERDICTS, 0.0)
    shares[verdict] = share
    shares["unnamed"] += 1.0 - share
    return Decision(verdict, shares, named, (), cast("Any", None))


def doubt(
    *kinds: Kind, where: str = EVERY, suspects: tuple[str, ...] = (), included: tuple[str, ...] = ()
) -> MistakeDoubt:
    found = tuple(Mistake(kind, where, "one", "another", "a slip", "the key") for kind in kinds)
    return MistakeDoubt(found, suspects, included)


def test_each_effect_that_describes_a_mistake_acts_on_what_is_checked() -> None:
    assert set(DESCRIBED_BY) <= set(get_args(MistakeKind))
    for kind, names in DESCRIBED_BY.items():
        rigs = {rig for check in CHECKS for rig in check.of if kind in check.finds}
        for effect in (EFFECTS[name] for name in names):
            own = {"tracks": effect.wing, "forces": effect.vehicle}
            acts = {*effect.observed, *(rig for rig, scene in own.items() if scene)}
            assert acts & rigs, (kind, effect.name)


def test_an_effect_that_describes_the_mistake_is_named() -> None:
    sure = decision("measurement fault", "axis_swap")
    assert doubt("force axes").applied(sure) is sure
    assert "The checks of the dataset find it, too (force axes)" in doubt("force axes").sentence(sure, sure)
    either = decision("ambiguous", "body_pitch_convention", "axis_sign")
    assert doubt("force axes").applied(either) is either


@pytest.mark.parametrize("share", [0.6, 0.8, 0.99])
@pytest.mark.parametrize("verdict", ["named", "partly named", "ambiguous", "measurement fault"])
def test_other_effects_are_not_named(verdict: Verdict, share: float) -> None:
    sure, doubted = decision(verdict, "stroke_bias", share=share), doubt("vertical sign")
    found = doubted.applied(sure)
    assert (found.verdict, found.named) == ("unnamed", ())
    assert of_the_library(found.probabilities) == pytest.approx(0.5 * share)
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    assert doubted.sentence(sure, found).endswith("No effect is named until then.")


def test_each_mistake_must_be_described() -> None:
    sure = decision("named", "marker_swap", "damage")
    assert doubt("swapped markers").applied(sure) is sure
    assert doubt("swapped markers", "vertical sign").applied(sure).verdict == "unnamed"


def test_effects_of_the_model_describe_a_mistake() -> None:
    sure = decision("named", "damage")
    assert doubt("swapped markers").applied(sure).verdict == "unnamed"
    assert doubt("swapped markers", included=("marker_swap",)).applied(sure) is sure


def test_no_effect_describes_the_mistake_of_one_recording() -> None:
    sure = decision("measurement fault", "axis_sign")
    [one] = doubt("force axes").mistakes
    alone = MistakeDoubt((replace(one, alone=True),), ("axis_sign",), ("axis_sign",))
    assert alone.applied(sure).verdict == "unnamed"
    late = MistakeDoubt((replace(one, kind="force phase", alone=True),), ("phase_reference",))
    assert late.applied(sure).verdict == "unnamed"


def test_another_start_of_the_beat_competes_as_an_effect_if_it_is_a_suspect() -> None:
    sure = decision("named", "wing_acceleration")
    assert doubt("force phase", suspects=("wing_acceleration", "phase_reference")).applied(sure) is sure
    assert doubt("force phase", suspects=("wing_acceleration",)).applied(sure).verdict == "unnamed"


def test_improbable_conditions_are_only_remarks_but_forces_show_wrong_ones() -> None:
    sure = decision("named", "body_drag")
    one = doubt("airspeed", where="recording 'a'")
    assert one.applied(sure) is sure
    assert one.sentence(sure, sure) == ""
    assert doubt("airspeed").applied(sure).verdict == "unnamed"


@pytest.mark.parametrize("verdict", ["adequate", "unnamed"])
def test_verdicts_without_names_stay(verdict: Verdict) -> None:
    sure, doubted = decision(verdict), doubt("vertical sign")
    assert doubted.applied(sure) is sure
    assert (CAUSE in doubted.sentence(sure, sure)) == (verdict == "unnamed")
    assert "until then" not in doubted.sentence(sure, sure)


def test_a_dataset_without_such_mistakes_is_not_doubted() -> None:
    sure = decision("named", "stroke_bias")
    for none in (doubt(), doubt("duplicate", "mass", "frozen marker")):
        assert none.applied(sure) is sure
        assert none.sentence(sure, sure) == ""
