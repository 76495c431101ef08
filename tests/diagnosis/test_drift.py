"""A rig that drifts while it is recorded is not called adequate: the drift is not taken for noise."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import GENES, PendulumRig, recorded
from wingfit.diagnosis import DiagnosisSpec, Finding, diagnose_subject
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.policy import POLICY
from wingfit.diagnosis.verdict.noise_remarks import drift_sentence, noise_remarks
from wingfit.diagnosis.verdict.weigh_hypotheses import drifts
from wingfit.inference.noise.changes.drift import Drift
from wingfit.inference.noise.changes.slow_change import Change
from wingfit.records import Recording
from wingfit.workers.in_process import InProcessEvaluator

FALLING, DIPPING = (0.5, 0.25, 0.0, -0.25, -0.5), (0.0, -0.7, -1.0, -0.7, 0.0)
NONE = Change(0.0, 1.0, 0.0)
FREQUENCIES = (1.2, 1.7, 2.7, 3.4)


def drifting(
    change: float, seed: int, frequencies: tuple[float, ...], course: tuple[float, ...] = FALLING
) -> tuple[Recording, ...]:
    """Recordings during which the stiffness changes along a ``course``, by the fraction ``change`` of the nominal."""
    stiffness = next(gene.nominal for gene in GENES if gene.name == "stiffness")
    every = [
        recorded({"stiffness": stiffness * (1.0 + part)}, noise=0.0, frequencies=frequencies, frames=248)
        for part in change * np.array(course)
    ]
    noisy = recorded({}, seed=seed, frequencies=frequencies, frames=248)
    quiet = recorded({}, noise=0.0, frequencies=frequencies, frames=248)
    found = []
    for k, one in enumerate(noisy):
        at = np.linspace(0.0, len(course) - 1.0, len(one.times))
        low = np.minimum(at.astype(int), len(course) - 2)
        share, values = (at - low)[:, None], np.stack([part[k].values for part in every])
        rows = np.arange(len(at))
        moving = (1.0 - share) * values[low, rows] + share * values[low + 1, rows]
        found.append(replace(one, values=moving + one.values - quiet[k].values))
    return tuple(found)


def diagnosed(change: float, seed: int = 1, course: tuple[float, ...] = FALLING) -> Finding:
    fitted, held_out = (drifting(change, seed + k, at, course) for k, at in enumerate((FREQUENCIES, (1.5,))))
    *_, last = diagnose_subject(PendulumRig(), "drifting", fitted, held_out, DiagnosisSpec(), InProcessEvaluator())
    assert last.finding is not None
    return last.finding


def test_a_steady_pendulum_is_adequate_and_nothing_is_said_about_drift() -> None:
    finding = diagnosed(0.0)
    assert finding.verdict == "adequate"
    assert not [remark for remark in finding.remarks if "drift" in remark]


@pytest.mark.parametrize(("change", "course"), [(0.05, FALLING), (0.2, FALLING), (0.1, DIPPING)])
def test_a_stiffness_that_drifts_is_neither_adequate_nor_an_effect_of_the_library(
    change: float, course: tuple[float, ...]
) -> None:
    finding = diagnosed(change, course=course)
    assert finding.verdict == "unnamed"
    (remark,) = [remark for remark in finding.remarks if "drifts" in remark]
    assert remark.startswith("the beat changes slowly during ")
    assert " mm, " in remark
    assert finding.summary.endswith("something drifts, which may be the cause.")


def test_no_place_is_claimed_where_only_a_drift_speaks_against_the_model() -> None:
    finding = diagnosed(0.05)
    where = finding.where
    assert where is not None
    assert (where.span, where.chord, where.phase, where.exponents) == (None, None, None, ())
    assert (finding.missing, finding.law) == ((), None)
    assert "the mean beat fits within the noise and shows no place" in finding.summary
    assert "of the span" not in finding.summary


def test_one_recording_that_drifts_among_many_is_enough() -> None:
    """The root mean square over all recordings would hide it."""
    others = tuple(1.2 + 0.2 * k for k in range(11))
    steady = recorded({}, seed=5, frequencies=others, frames=248)
    assert not drifts(WhitenedData.of(steady))
    data = WhitenedData.of((*drifting(0.02, 1, (1.7,)), *steady))
    assert drifts(data)
    assert np.flatnonzero(data.drift).tolist() == [0]


def test_an_effect_explains_a_drift_although_noise_remains() -> None:
    noisy, quiet = drifting(0.03, 1, (1.7,)), recorded({}, seed=5, frequencies=(1.2, 2.7, 3.4), frames=248)
    data = WhitenedData.of((*noisy, *quiet))
    steady = recorded({}, seed=1, frequencies=(1.7,), frames=248)
    before, left = (
        data.change_of_beat(data.coefficients_of([r.values for r in (*one, *quiet)])) for one in (noisy, steady)
    )
    assert left < 0.1 * before


def test_a_mean_that_drifts_is_not_adequate() -> None:
    def moved(frequencies: tuple[float, ...], seed: int) -> list[Recording]:
        steady = recorded({}, seed=seed, frequencies=frequencies, frames=496)
        return [replace(one, values=one.values + 2e-3 * np.linspace(-1, 1, 496)[:, None]) for one in steady]

    *_, last = diagnose_subject(
        PendulumRig(), "drifting", moved(FREQUENCIES, 1), moved((1.5,), 2), DiagnosisSpec(), InProcessEvaluator()
    )
    finding = last.finding
    assert finding is not None
    assert finding.verdict != "adequate"
    (remark,) = [remark for remark in finding.remarks if "drifts" in remark]
    assert "its mean by 1.1" in remark


def test_odd_and_even_beats_that_differ_are_not_adequate() -> None:
    def alternating(frequencies: tuple[float, ...], seed: int) -> list[Recording]:
        steady = recorded({}, seed=seed, frequencies=frequencies, frames=496)
        odd = [np.sign(np.sin(np.pi * one.condition.flap_frequency * one.times))[:, None] for one in steady]
        return [replace(one, values=one.values * (1.0 + 0.1 * sign)) for one, sign in zip(steady, odd, strict=True)]

    *_, last = diagnose_subject(
        PendulumRig(), "odd", alternating(FREQUENCIES, 1), alternating((1.5,), 2), DiagnosisSpec(), InProcessEvaluator()
    )
    finding = last.finding
    assert finding is not None
    assert finding.verdict == "unnamed"
    (remark,) = [remark for remark in finding.remarks if "beats differ periodically" in remark]
    assert "check the stated frequency and the drive" in remark
    assert "The beats of 4 of 4 recordings differ periodically" in finding.summary


def test_a_change_of_the_mean_counts_where_the_mean_drifts() -> None:
    """And that of the first harmonic where the beat does."""
    steady = recorded({}, seed=1, frequencies=(1.7,), frames=496)
    ramp = 2e-3 * np.linspace(-1, 1, 496)[:, None]
    data = WhitenedData.of([replace(one, values=one.values + ramp) for one in steady])
    assert data.drift[0] > 1.0
    of_ramp, of_beat = (
        data.coefficients_of([np.broadcast_to(one, (496, data.recordings[0].values.shape[1]))])
        for one in (ramp, ramp * np.cos(2 * np.pi * 1.7 * data.recordings[0].times)[:, None])
    )
    assert data.change_of_beat(of_ramp) > 0.5e-6
    assert data.change_of_beat(of_beat) < 0.1e-6


@pytest.mark.parametrize(
    ("size", "says"), [(1.0, "which may be the cause"), (0.2, "by too little to matter"), (0.0, "")]
)
def test_the_sentence_fits_the_verdict(size: float, says: str) -> None:
    """Size of the drift of one recording, in its noise."""
    drift = Drift(Change(9.0, 1e-9, 1e-3 * size), NONE) if size else None
    fits = [SimpleNamespace(drift=one, shared=0.0, modulation=None) for one in (drift, None)]
    recordings = [SimpleNamespace(name=name) for name in ("a", "b")]
    every = np.array([size, 0.0])
    data = SimpleNamespace(recordings=recordings, beat_fits=fits, tolerance=1e-4, drift=every, policy=POLICY)
    sentence = drift_sentence(cast("WhitenedData", data), explained=False)
    assert says in sentence
    assert bool(sentence) == bool(size)
    explained = drift_sentence(cast("WhitenedData", data), explained=True)
    assert ("as the added effects explain" in explained) == bool(size)
    assert "cause" not in explained


@pytest.mark.parametrize("others", [(1.7,), (1.2, 1.7, 2.0, 2.7)])
def test_a_recording_with_several_times_the_noise_of_others_is_remarked(others: tuple[float, ...]) -> None:
    loud = recorded({}, noise=1e-3, frequencies=(3.4,))
    (remark,) = noise_remarks(WhitenedData.of((*recorded({}, frequencies=others), *loud)), "m")
    assert remark.startswith(f"the noise of {loud[0].name} (0.993 mm) is more than 3 times the 0.19")
    assert "of quieter recordings" in remark


def test_an_adequate_model_is_not_certain_where_one_recording_is_noisier() -> None:
    """What is missing may hide in its noise; the fit of the others is as good as ever."""
    fitted = (*recorded({}, seed=1, frequencies=FREQUENCIES[:3]), *recorded({}, noise=1e-3, seed=2, frequencies=(3.4,)))
    held_out = recorded({}, seed=3, frequencies=(1.5,))
    *_, last = diagnose_subject(PendulumRig(), "loud", fitted, held_out, DiagnosisSpec(), InProcessEvaluator())
    assert last.finding is not None
    assert last.finding.verdict == "adequate"
    assert last.finding.probabilities["adequate"] == pytest.approx(POLICY.doubted_noise)
    assert "see the remarks" in last.finding.summary


def test_an_adequate_model_is_not_certain_where_no_mean_beat_is_known_well() -> None:
    """Noise as large as the motion: the mean beat has an error of a quarter of it, so that much may be missing."""
    fitted = recorded({}, noise=4e-3, seed=1, frequencies=FREQUENCIES)
    data = WhitenedData.of(fitted)
    assert 0.1 < np.median(data.uncertainty_of_beats) < 0.5
    *_, last = diagnose_subject(PendulumRig(), "faint", fitted, (), DiagnosisSpec(), InProcessEvaluator())
    assert last.finding is not None
    assert last.finding.verdict == "adequate"
    assert last.finding.probabilities["adequate"] == pytest.approx(POLICY.doubted_noise)
    assert any("the mean beat is known to only" in remark for remark in last.finding.remarks)


def test_recordings_without_noise_get_no_remark_on_it() -> None:
    """Theirs is round-off, which differs by any factor."""
    assert noise_remarks(WhitenedData.of(recorded({}, noise=0.0, frequencies=(1.2, 2.0, 3.4))), "m") == ()
