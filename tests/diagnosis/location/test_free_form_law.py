"""A law for the missing load that predicts left-out recordings is found and described; else there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from tests.diagnosis.loaded import case, model, nominal, recorded_tracks
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
def added_mass_cases() -> tuple[tuple[Case, ...], tuple[StationMotion, ...]]:
    """Cases of a wing with added mass and a nominal model without it."""
    plant = replace(model("4"), effects=("added_mass",))
    genome = nominal(plant)
    genome[[gene.name for gene in plant.genes].index("added_mass.k")] = MASS
    found = [
        case(model("4"), recorded_tracks(plant, genome, condition, np.random.default_rng(k)), PROBE)
        for k, condition in enumerate(CONDITIONS)
    ]
    return tuple(one for one, _ in found), tuple(answers.motion for _, answers in found)


def cases_with(loads: Sequence[Array], seed: int = 0) -> list[Case]:
    """Cases whose residual is the response to ``loads`` [J, N] at the motions' phases, plus noise."""
    rng, cases = np.random.default_rng(seed), []
    for one, motion, load in zip(*added_mass_cases(), loads, strict=True):
        series = np.linalg.pinv(PROBE.terms(motion.phase + one.crossing))
        sizes = (load @ series.T).ravel()
        cases.append(replace(one, residual=one.responses @ sizes + rng.standard_normal(len(one.residual))))
    return cases


def test_added_mass_is_identified_with_its_coefficient() -> None:
    """-pi / 4 k rho c^2 a_n (Sedov 1965), all genes of the nominal model free."""
    cases, motions = added_mass_cases()
    law = free_law(cases, PROBE, motions)
    assert law is not None
    assert law.terms[0].feature == "rho c^2 a_n"
    assert law.terms[0].coefficient.value == pytest.approx(-np.pi / 4 * MASS, rel=0.15)
    assert law.explained > 0.8
    assert "air density and the local normal acceleration" in law.words


@pytest.mark.parametrize(
    ("name", "coefficient"), [("rho c |V_n| V_n (outer 40 % of the span)", -2.0), ("sign V_n", -1.0), ("w^3", -2e5)]
)
def test_simulated_laws_are_recovered(name: str, coefficient: float) -> None:
    motions = added_mass_cases()[1]
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


def test_random_loads_have_no_law() -> None:
    """A different load in every recording."""
    motions, rng = added_mass_cases()[1], np.random.default_rng(8)
    hats = PROBE.hats(np.array(PROBE.stations))
    loads = [hats @ rng.standard_normal((5, 17)) @ PROBE.terms(motion.phase).T for motion in motions]
    law = free_law(cases_with(loads), PROBE, motions)
    assert law is not None
    assert law.terms == ()
    assert law.explained < 0.1
    assert "no simple law" in law.words


def test_two_recordings_are_too_few() -> None:
    cases, motions = added_mass_cases()
    assert free_law(cases[:2], PROBE, motions[:2]) is None


def test_features_have_the_dimension_of_a_load() -> None:
    """With lengths doubled at the same frequency and density, loads of the air per span scale by 2^3."""
    motion = added_mass_cases()[1][0]
    lengths = ("velocity", "forward", "acceleration", "deflection", "chord")
    larger = replace(motion, airspeed=2 * motion.airspeed, **{key: 2 * getattr(motion, key) for key in lengths})
    for one in candidates():
        if one.feature.name.startswith("rho"):
            np.testing.assert_allclose(one.field(larger), 8 * one.field(motion), rtol=1e-12, err_msg=one.name)
