"""A rig that drifts while it is recorded is not called adequate: the drift is not taken for noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import GENES, PendulumRig, recorded
from wingfit.diagnosis import DiagnosisSpec, Finding, diagnose_subject
from wingfit.records import Recording
from wingfit.workers.in_process import InProcessEvaluator

PARTS = 5


def drifting(change: float, seed: int, frequencies: tuple[float, ...]) -> tuple[Recording, ...]:
    """Recordings during which the stiffness falls linearly by the fraction ``change`` of its nominal value."""
    stiffness = next(gene.nominal for gene in GENES if gene.name == "stiffness")
    every = [
        recorded({"stiffness": stiffness * (1.0 + part)}, noise=0.0, frequencies=frequencies, frames=248)
        for part in change * np.linspace(0.5, -0.5, PARTS)
    ]
    noisy = recorded({}, seed=seed, frequencies=frequencies, frames=248)
    quiet = recorded({}, noise=0.0, frequencies=frequencies, frames=248)
    found = []
    for k, one in enumerate(noisy):
        at = np.linspace(0.0, PARTS - 1.0, len(one.times))
        low = np.minimum(at.astype(int), PARTS - 2)
        share, values = (at - low)[:, None], np.stack([part[k].values for part in every])
        rows = np.arange(len(at))
        moving = (1.0 - share) * values[low, rows] + share * values[low + 1, rows]
        found.append(replace(one, values=moving + one.values - quiet[k].values))
    return tuple(found)


def diagnosed(change: float, seed: int = 1) -> Finding:
    fitted, held_out = drifting(change, seed, (1.2, 1.7, 2.7, 3.4)), drifting(change, seed + 1, (1.5,))
    *_, last = diagnose_subject(PendulumRig(), "drifting", fitted, held_out, DiagnosisSpec(), InProcessEvaluator())
    assert last.finding is not None
    return last.finding


def test_a_steady_pendulum_is_adequate_and_nothing_is_said_about_drift() -> None:
    finding = diagnosed(0.0)
    assert finding.verdict == "adequate"
    assert not [remark for remark in finding.remarks if "drift" in remark]


@pytest.mark.parametrize("change", [0.05, 0.2])
def test_a_stiffness_that_drifts_is_neither_adequate_nor_an_effect_of_the_library(change: float) -> None:
    finding = diagnosed(change)
    assert finding.verdict == "unnamed"
    (remark,) = [remark for remark in finding.remarks if "drifts" in remark]
    assert remark.startswith("the beat changes slowly during ")
    assert " mm, " in remark


def test_a_recording_with_several_times_the_usual_noise_is_remarked() -> None:
    fitted = (*recorded({}, frequencies=(1.2, 1.7, 2.0, 2.7)), *recorded({}, noise=1e-3, frequencies=(3.4,)))
    *_, last = diagnose_subject(PendulumRig(), "loud", fitted, (), DiagnosisSpec(), InProcessEvaluator())
    assert last.finding is not None
    (remark,) = [remark for remark in last.finding.remarks if remark.startswith("the noise of ")]
    assert fitted[-1].name in remark
    assert "more than 3 times the usual 0.199 mm" in remark
