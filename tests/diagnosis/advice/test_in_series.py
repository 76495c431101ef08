"""What to record next with a rig that the user simulates: what distinguishes the hypotheses that remain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import wingfit
from tests.rigs.oscillator import UNFORCED, blank
from wingfit.diagnosis.advice.proposal import ALIKE
from wingfit.diagnosis.advice.rivals import forgotten
from wingfit.diagnosis.advice.series_candidates import candidates
from wingfit.diagnosis.evidence.fit import PRIOR_SD
from wingfit.diagnosis.finding import Finding
from wingfit.records import Channel, Quantity, Series, SeriesDataset
from wingfit.rigs.rig_model import RigModel

NOISE = 0.002  # m
SMALL = 0.075  # N: dry friction that these recordings hardly show
RIG = replace(UNFORCED, faults=False)


def recorded(name: str, start: float, mass: float, seed: int) -> Series:
    empty = blank(
        name,
        quantities=(Channel("position", "m", NOISE),),
        values=np.zeros((160, 1)),
        settings={"mass": mass},
        estimates={"start": start},
    )
    model = RigModel(RIG, (empty,)).with_effects("dry_friction.slide")
    genes = {"stiffness": 45.0, "damping": 0.25, "start": start, "speed": 0.0, "dry_friction.slide.size": SMALL}
    noise = NOISE * np.random.default_rng(seed).standard_normal((160, 1))
    return replace(empty, values=model.simulated(genes, empty).channels + noise)


@pytest.fixture(scope="module")
def finding() -> Finding:
    recordings = (recorded("a", 0.05, 1.0, 3), recorded("b", 0.06, 1.5, 4), recorded("c", 0.055, 1.0, 5))
    channel, mass = recordings[0].quantities[0], Quantity("mass", "kg")
    dataset = SeriesDataset("d", RIG.name, recordings, (channel,), (), (mass,), ("c",))
    suspects = ("dry_friction.slide", "square_drag.slide", "cubic_stiffness.slide")
    return wingfit.diagnose(dataset, wingfit.DiagnosisSpec(suspects=suspects), rig=RIG)


def test_the_advice_names_recording_and_change(finding: Finding) -> None:
    assert finding.verdict == "ambiguous"
    assert len(finding.advice) >= 3
    decides = [one.resolves for one in finding.advice]
    assert all(one is not None and 0.0 <= one <= 1.0 for one in decides)
    assert max(one or 0.0 for one in decides) - (decides[0] or 0.0) <= ALIKE
    by_change = {(one.recording, one.change): one.separation for one in finding.advice}
    again = by_change["a", "as it was"]
    # Dry friction is a larger part of the forces where the motion is small.
    assert by_change["a", "with a start 0.5 times as large"] > 1.2 * again
    assert {recording for recording, _ in by_change} <= {"a", "b"}  # what is held out is not simulated
    assert {one.kind for one in finding.advice} == {"condition", "repeat"}
    assert all(one.cost is not None and one.cost.seconds > 0.0 and one.cost.frames == 160 for one in finding.advice)
    assert any("record a again" in one.words for one in finding.advice)
    assert "Next recording" in wingfit.html(finding)


def test_candidates_change_one_thing_within_what_was_recorded() -> None:
    push = np.ones(160)
    a = blank("a", settings={"mass": 1.0}, inputs={"push": 2.0 * push}, repeats="one")
    again = replace(a, name="again")
    b = blank("b", settings={"mass": 1.5}, inputs={"push": 3.0 * push})
    found = [(one.recording.name, one.change) for one in candidates([a, again, b])]
    assert found == [
        ("a", "as it was"),
        ("b", "as it was"),
        ("a", "with a start 0.5 times as large"),
        ("a", "with a start 2 times as large"),
        ("b", "with a start 0.5 times as large"),
        ("b", "with a start 2 times as large"),
        ("a", "with mass 1.5"),
        ("a", "with inputs 0.5 times as large"),
        ("a", "with inputs 1.5 times as large"),
        ("b", "with mass 1"),
        ("b", "with inputs 0.5 times as large"),
    ]
    largest = next(one for one in candidates([a, again, b]) if "1.5 times" in one.change)
    np.testing.assert_array_equal(largest.recording.inputs["push"], 3.0 * push)


def test_a_start_that_is_new_keeps_what_was_known_of_the_other_genes() -> None:
    """The information on the rest is that of the marginal distribution (inverse of a block of the covariance)."""
    slopes = np.random.default_rng(0).standard_normal((12, 4))
    information = slopes.T @ slopes + 4.0 * np.eye(4)
    unknown = np.array([False, True, False, True])
    found = forgotten(information, unknown)
    marginal = np.linalg.inv(information)[np.ix_(~unknown, ~unknown)]
    np.testing.assert_allclose(found[np.ix_(~unknown, ~unknown)], np.linalg.inv(marginal), rtol=1e-10)
    np.testing.assert_allclose(found[np.ix_(unknown, unknown)], np.eye(2) / PRIOR_SD**2)
    np.testing.assert_allclose(found[np.ix_(~unknown, unknown)], 0.0)
    np.testing.assert_array_equal(forgotten(information, np.zeros(4, bool)), information)
