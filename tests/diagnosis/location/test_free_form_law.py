"""A law for the missing load that predicts other recordings is found and told in words; none where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from tests.diagnosis.loaded import case, filmed, model, nominal
from wingfit.diagnosis.location.free_form_law import free_law
from wingfit.diagnosis.location.law_features import candidates
from wingfit.diagnosis.location.missing_load import Case
from wingfit.sim.effects.probe import Probe
from wingfit.sim.virtual_rigs.campaign import tunnel, vacuum
from wingfit.sim.wing.probing import StationMotion

Array = npt.NDArray[np.float64]

PROBE = Probe()
CONDITIONS = (
    vacuum(10.0, 0.05, 3.0),
    vacuum(1000.0, 0.12, 4.0),
    vacuum(1000.0, 0.0, 3.0),
    vacuum(500.0, 0.05, 4.0),
    tunnel(0.05, 3.0, 6.0),
)
MASS = 0.3  # of the added mass of a flat plate


@cache
def heavier() -> tuple[tuple[Case, ...], tuple[StationMotion, ...]]:
    """A wing that moves air along, and a model of it that does not know."""
    plant = replace(model("4"), effects=("added_mass",))
    genome = nominal(plant)
    genome[[gene.name for gene in plant.genes].index("added_mass.k")] = MASS
    found = [
        case(model("4"), filmed(plant, genome, condition, np.random.default_rng(k)), PROBE)
        for k, condition in enumerate(CONDITIONS)
    ]
    return tuple(one for one, _ in found), tuple(answers.motion for _, answers in found)


def cases_with(loads: Sequence[Array], seed: int = 0) -> list[Case]:
    """Cases that lack loads [J, N] at the motions' phases, and noise."""
    rng, cases = np.random.default_rng(seed), []
    for one, motion, load in zip(*heavier(), loads, strict=True):
        series = np.linalg.pinv(PROBE.terms(motion.phase + one.crossing))
        sizes = (load @ series.T).ravel()
        cases.append(replace(one, residual=one.responses @ sizes + rng.standard_normal(len(one.residual))))
    return cases


def test_added_mass_is_told_from_tracks_with_its_coefficient() -> None:
    """-pi / 4 k rho c^2 a_n (Sedov 1965), all genes of the nominal model free."""
    cases, motions = heavier()
    law = free_law(cases, PROBE, motions)
    assert law is not None
    assert law.terms[0].feature == "rho c^2 a_n"
    assert law.terms[0].coefficient.value == pytest.approx(-np.pi / 4 * MASS, rel=0.15)
    assert law.explained > 0.8
    assert "air density and the local normal acceleration" in law.words


@pytest.mark.parametrize(
    ("name", "coefficient"), [("rho c |V_n| V_n (outer 40 % of the span)", -2.0), ("sign V_n", -1.0), ("w^3", -2e5)]
)
def test_laws_of_the_dictionary_are_found_again(name: str, coefficient: float) -> None:
    motions = heavier()[1]
    (candidate,) = (one for one in candidates() if one.name == name)
    law = free_law(cases_with([coefficient * candidate.field(motion) for motion in motions]), PROBE, motions)
    assert law is not None
    assert law.terms[0].feature == name
    low, high = law.terms[0].coefficient.low, law.terms[0].coefficient.high
    assert low is not None
    assert high is not None
    assert law.terms[0].coefficient.value == pytest.approx(coefficient, rel=0.1)
    assert low < law.terms[0].coefficient.value < high
    assert law.explained > 0.8
    assert candidate.words in law.words


def test_loads_of_no_law_predict_nothing() -> None:
    """Another load in every recording."""
    motions, rng = heavier()[1], np.random.default_rng(8)
    hats = PROBE.hats(np.array(PROBE.stations))
    loads = [hats @ rng.standard_normal((5, 17)) @ PROBE.terms(motion.phase).T for motion in motions]
    law = free_law(cases_with(loads), PROBE, motions)
    assert law is not None
    assert law.terms == ()
    assert law.explained < 0.1
    assert "no simple law" in law.words


def test_two_recordings_are_too_few() -> None:
    cases, motions = heavier()
    assert free_law(cases[:2], PROBE, motions[:2]) is None


def test_features_have_the_dimension_of_a_load() -> None:
    """Lengths doubled at the same frequency and density: those of the air grow with the fourth power less one."""
    motion = heavier()[1][0]
    lengths = ("velocity", "forward", "acceleration", "deflection", "chord")
    larger = replace(motion, airspeed=2 * motion.airspeed, **{key: 2 * getattr(motion, key) for key in lengths})
    for one in candidates():
        if one.feature.name.startswith("rho"):
            np.testing.assert_allclose(one.field(larger), 8 * one.field(motion), rtol=1e-12, err_msg=one.name)
