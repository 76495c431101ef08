"""Trials on a wing of another engine: what is drawn, what is changed, and what counts as right."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import other_engine as bench
from benchmarks.peers.wing import peer_wing
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing


def row(hidden: str, verdict: str, *named: str, first: tuple[str, ...] = (), strength: float = 2.0) -> dict[str, Any]:
    hypotheses = (SimpleNamespace(effects=()), SimpleNamespace(effects=first or named))
    found: Any = SimpleNamespace(
        verdict=verdict, named=named, hypotheses=hypotheses, probabilities={verdict: 0.97}, strength=strength
    )
    return {"hidden": hidden} | bench.judged(found, bench.HIDDEN[hidden].right)


def test_a_third_hides_nothing_and_everything_is_hidden() -> None:
    trials = [bench.planned(1, number) for number in range(30)]
    assert [one.hidden for one in trials].count("nothing") == 10
    assert {one.hidden for one in trials} == set(bench.HIDDEN)
    assert {one.division for one in trials} == set(bench.DIVISIONS)
    assert {one.law for one in trials} == {"angles", "logarithm"}
    assert trials == [bench.planned(1, number) for number in range(30)]


@pytest.mark.parametrize("name", [name for name in bench.HIDDEN if name not in ("nothing", "scale of the tracks")])
def test_each_thing_changes_the_wing(name: str) -> None:
    model, (condition, _) = FlexibleWing(robird_wing(), "4"), bench.CONDITIONS[-1]
    wing = peer_wing(model.structure, model.genes, np.array([gene.nominal for gene in model.genes]), condition)
    changed = bench.HIDDEN[name].change(wing, bench.HIDDEN[name].high)
    differ = [field for field in wing._fields if not np.array_equal(getattr(wing, field), getattr(changed, field))]
    assert len(differ) == 1


def test_right_and_wrong_verdicts_are_counted() -> None:
    rows = [
        row("nothing", "adequate"),
        row("nothing", "named", "damage"),
        row("nothing", "named", "cubic_stiffness"),
        row("airspeed", "named", "airspeed_error"),
        row("airspeed", "named", "airspeed_error", "damage"),
        row("stroke amplitude", "adequate", first=("stroke_amplitude",)),
        row("upwash", "unnamed"),
        row("damped joint", "named", "viscoelastic"),
        row("soft joint", "ambiguous", "damage", "backlash"),
        row("airspeed", "adequate", strength=1.03),
    ]
    total = bench.summary(rows)
    assert total["nothing_hidden"] == {"n": 3, "adequate_percent": 33.3, "law_of_springs_named": 1}
    assert total["listed"] == {"n": 4, "first_percent": 50.0, "right_percent": 25.0, "adequate_percent": 25.0}
    assert total["unlisted"] == {"n": 2, "unnamed_percent": 50.0, "adequate_percent": 0.0}
    assert total["too_weak"] == {"n": 1}
    assert total["wrong_percent"] == 30.0
    assert total["said_95"] == {"n": 10, "right_percent": 60.0}


def test_the_motion_of_the_engine_is_filmed() -> None:
    pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install 'wingfit[peers]'")
    trial = bench.planned(1, 0)
    model, (condition, _) = FlexibleWing(robird_wing(), "4"), bench.CONDITIONS[-1]
    genome = np.array([gene.nominal for gene in model.genes])
    tracks = bench._beat(trial, model, genome, condition)
    assert tracks.shape == (60, 49, 3)
    assert np.ptp(tracks[:, -1, 2]) > 0.1
