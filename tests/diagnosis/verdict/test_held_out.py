"""Held-out recordings refute a model that the fitted ones cannot, unless noise or the genes explain their misfit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import wingfit
from tests.rigs.oscillator import UNFORCED, blank
from wingfit.records import Channel, Quantity, Series, SeriesDataset
from wingfit.rigs.rig_model import RigModel

NOISE = 0.001  # m
RIG = replace(UNFORCED, faults=False)
SUSPECTS = wingfit.DiagnosisSpec(suspects=("dry_friction.slide", "square_drag.slide"))


def recorded(name: str, start: float, cubic: float, *, samples: int = 160, damping: float = 0.25) -> Series:
    empty = blank(
        name,
        samples=samples,
        last=4.0 * samples / 160,
        quantities=(Channel("position", "m", NOISE),),
        values=np.zeros((samples, 1)),
        settings={"mass": 1.0},
        estimates={"start": start},
    )
    model = RigModel(RIG, (empty,)).with_effects("cubic_stiffness.slide")
    genes = {"stiffness": 45.0, "damping": damping, "start": start, "speed": 0.0, "cubic_stiffness.slide.size": cubic}
    noise = NOISE * np.random.default_rng(len(name)).standard_normal((samples, 1))
    return replace(empty, values=model.simulated(genes, empty).channels + noise)


def diagnosed(*recordings: Series, held_out: str) -> wingfit.Finding:
    dataset = SeriesDataset(
        "d", RIG.name, recordings, recordings[0].quantities, (), (Quantity("mass", "kg"),), (held_out,)
    )
    return wingfit.diagnose(dataset, SUSPECTS, rig=RIG)


def test_a_law_that_only_a_large_motion_shows_is_missed_by_the_held_out_recording() -> None:
    small = [recorded("a", 0.02, 800.0), recorded("bb", 0.018, 800.0)]
    found = diagnosed(*small, recorded("ccc", 0.08, 800.0), held_out="ccc")
    assert found.verdict == "unnamed"
    assert found.probabilities["adequate"] == 0.0
    assert "The fitted recordings do not show it, but the held-out ones do" in found.summary
    assert found.strength < 1.3  # in the fitted recordings


def test_a_right_model_is_adequate_in_a_larger_motion() -> None:
    small = [recorded("a", 0.02, 0.0), recorded("bb", 0.018, 0.0)]
    found = diagnosed(*small, recorded("ccc", 0.03, 0.0), held_out="ccc")
    assert found.verdict == "adequate"
    assert found.probabilities["adequate"] >= 0.6


def test_genes_that_the_fitted_recordings_do_not_determine_explain_a_misfit() -> None:
    """Two short recordings hardly show the damping, which the long one depends on."""
    short = [recorded("a", 0.01, 0.0, samples=40, damping=0.6), recorded("bb", 0.012, 0.0, samples=40, damping=0.6)]
    found = diagnosed(*short, recorded("ccc", 0.2, 0.0, samples=320, damping=0.6), held_out="ccc")
    assert found.verdict == "adequate"
    assert found.proof is not None
    assert found.proof.before.value > 1.2
