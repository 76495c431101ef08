"""What every effect must declare, and what the contract rejects."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.sim.effects.rigs import bare, recordings, rig_of
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.rigs import subject_of
from wingfit.records import Dataset
from wingfit.sim.effects.contract import FAMILIES, Effect
from wingfit.sim.effects.registry import EFFECTS

SYMBOLS = {"m", "kg", "s", "Hz", "rad", "N", "Pa", "W", "J", "K"}  # of units: SI and radians
CASES = [
    (name, kind)
    for name, effect in EFFECTS.items()
    for kind in ("wing", "vehicle")
    if effect.applies_to(rig_of(bare(kind)))
]


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=lambda effect: effect.name)
def test_is_declared_well(effect: Effect) -> None:
    names = [p.name for p in effect.parameters]
    assert effect.size
    assert len(set(names)) == len(names)
    assert all(re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name) for name in (effect.name, *names))
    assert any(p.typical for p in effect.size)
    for p in effect.parameters:
        assert p.unit
        assert set(re.findall("[A-Za-z]+", p.unit)) <= SYMBOLS, p
        assert -math.inf < p.lower <= p.typical <= p.upper < math.inf, p
        assert p.description
    for p in effect.size:
        assert p.lower <= 0.0 <= p.upper, p
    assert effect.title
    assert effect.signature
    assert effect.observe or effect.wing or effect.vehicle


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=lambda effect: effect.name)
def test_names_an_author_and_a_year(effect: Effect) -> None:
    assert re.search(r"[A-Z]\w+.*\b(1[6-9]|20)\d\d\b", effect.source), effect.source


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=lambda effect: effect.name)
def test_names_what_it_is_confused_with(effect: Effect) -> None:
    assert effect.confused_with
    assert effect.name not in effect.confused_with
    for other in effect.confused_with:
        assert other in EFFECTS, f"{effect.name} is confused with {other!r}, which is not registered"


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_genes_are_off_and_within_bounds(name: str, kind: str) -> None:
    effect, rig = EFFECTS[name], rig_of(bare(kind))
    genes = effect.genes(rig)
    typical = effect.typical(rig)
    assert [g.name for g in genes] == [f"{name}.{p.name}" for p in effect.parameters_of(rig)] == list(typical)
    for gene in genes:
        gene.check(typical[gene.name])
    assert effect.on(genes, np.array([[g.nominal for g in genes], list(typical.values())])).tolist() == [False, True]


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        (
            "camera_shift",
            {"family": "aerodynamics"},
            r"'camera_shift': family 'aerodynamics' does not fit",
        ),
        (
            "tether",
            {"family": "measurement"},
            r"family 'measurement' does not fit port 'point', which takes 'str",
        ),
        ("tether", {"family": "aerodynamics"}, r"family 'aerodynamics' does not fit port 'point'.*another port"),
        ("added_mass", {"port": "drive"}, r"family 'aerodynamics' does not fit port 'drive', which takes 'actuation'"),
        ("camera_shift", {"observe": None}, r"'camera_shift' on port 'observation'.*both are needed there"),
        ("camera_shift", {"observed": ()}, r"'camera_shift' on port 'observation'.*both are needed there"),
        ("tether", {"observed": ("tracks",)}, r"'tether' on port 'point': observe and observed belong to"),
        ("tether", {"law": ""}, r"law '' must be an equation"),
        ("tether", {"law": "a spring of stiffness k"}, r"must be an equation"),
        ("tether", {"law": "F = -K (x - x_0)"}, r"must be an equation that names at least one of its sizes k, c"),
        ("tether", {"law": "F = station chord"}, r"at least one of its sizes k, c: write it with the names"),
    ],
)
def test_a_contradictory_declaration_is_rejected(name: str, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(EFFECTS[name], **changes)


def test_every_port_takes_some_family_and_every_family_has_a_port() -> None:
    assert {effect.port for effect in EFFECTS.values()} == set(FAMILIES)
    assert {effect.family for effect in EFFECTS.values()} == {family for taken in FAMILIES.values() for family in taken}


@pytest.mark.parametrize("kind", ["wing", "vehicle"])
def test_the_diagnosis_suspects_every_effect_that_is_no_term_of_the_model(kind: str) -> None:
    model = bare(kind)
    dataset = Dataset(kind, rig_of(model), (recordings(kind)["air"],))
    suspects = [one.name for one in subject_of(dataset, CalibrationSpec(division="4")).suspects]
    fits = [name for name, effect in EFFECTS.items() if kind == "wing" or effect.fits(getattr(model, "terms", ()))]
    assert suspects == [name for name, where in CASES if where == kind and name in fits]
