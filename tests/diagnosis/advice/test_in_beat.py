"""Proposals for a rig with a beat: only what the genes of a rival cannot compensate distinguishes hypotheses."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import SUSPECTS, Pendulum, PendulumRig, at, recorded
from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.advice.in_beat import LONGER, OVERLOAD, InBeat, cost_of, overloads
from wingfit.diagnosis.advice.predictions import first_prediction, fixed_separation
from wingfit.diagnosis.advice.proposal import Proposal
from wingfit.diagnosis.advice.rivals import Rivals
from wingfit.diagnosis.advice.settling import Settling
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import Fit, gauss_newton_fit
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights
from wingfit.sim.virtual_rigs.balance import TRIALS, blank_recording
from wingfit.workers.in_process import InProcessEvaluator

RIG, EVALUATOR = PendulumRig(), InProcessEvaluator()
TRUTH = {"stiffness": 0.2, "damping": 4e-3, "inertia": 1e-3}
WIDE = (1.2, 1.7, 2.0, 2.7, 3.4)


def pendulum(data: WhitenedData, effects: tuple[str, ...], truth: dict[str, float], steps: int) -> Refit:
    """The pendulum with ``effects``, fitted from the ``truth`` in so many steps."""
    model = Pendulum(effects)
    problem = Problem(model, data.recordings, model.searched, base_genome(model, truth), data.axes)
    genes = free_genes(problem)
    start = unit_at(genes, np.array([problem.base[gene.name] for gene in genes]))
    found: Fit
    *_, found = gauss_newton_fit(FitContext(RIG, data, EVALUATOR), problem, start, steps)
    known = {one.name: one for one in SUSPECTS}
    trials = cast("Any", tuple(SimpleNamespace(suspect=known[name], freedom=1) for name in effects))
    return Refit(trials, found, data.excess(found.coefficients), None)


def search(frequencies: tuple[float, ...], **missing: float) -> InBeat:
    """The search between the truth, at its exact genes, and a fitted pendulum with a gain."""
    truth = {**TRUTH, **missing}
    data = WhitenedData.of(recorded(truth, noise=2e-4, frequencies=frequencies))
    first = pendulum(data, ("cubic",) if missing else (), truth, 0)
    rival = pendulum(data, ("gain",), TRUTH, 15)
    half = np.array([0.5, 0.5])
    weights = HypothesisWeights((first, rival), np.zeros(2), half, 0.0, np.array([0.1, 0.1]))
    rivals = Rivals.among(data, weights)
    assert rivals.numbers == (0, 1)
    return InBeat(FitContext(RIG, data, EVALUATOR), rivals, Settling(data, weights, (0, 1), 0.0))


def test_a_balance_is_not_overloaded() -> None:
    """The largest axis of all recordings counts; samples that are missing do not. Tracks have no load."""
    light = blank_recording(TRIALS[0].condition, "light", 4)
    light = replace(light, values=np.array([[0.1, 0.2], [np.nan, -0.2], [0.1, 0.2], [0.1, -0.2]]))
    heavy = replace(light, values=2.0 * light.values)
    allowed, refused = (replace(light, values=part * OVERLOAD * heavy.values) for part in (0.99, 1.01))
    assert not overloads(allowed, [light, heavy])
    assert overloads(refused, [light, heavy])
    assert overloads(replace(refused, values=refused.values[:, ::-1].copy()), [light, heavy])
    tracks = recorded(TRUTH)[0]
    assert not overloads(replace(tracks, values=100.0 * tracks.values), [tracks])


def apart(found: InBeat, then: float) -> tuple[Proposal, float]:
    """The proposal of a recording at ``then`` (Hz), and the separation with fixed genes."""
    recording = first_prediction(found.context, found.rivals, at(then))
    assert recording is not None
    proposal, plain = found._condition(recording), fixed_separation(found.context, found.rivals, recording)
    assert proposal is not None
    assert plain is not None
    return proposal, plain


@pytest.fixture(scope="module")
def hardening() -> InBeat:
    return search(WIDE, **{"cubic.k3": 0.3})


def test_a_rival_adapts_its_genes_to_a_new_recording() -> None:
    """At one frequency stiffness and inertia compensate each other, so another frequency is predicted wrongly."""
    proposal, plain = apart(search((1.2,)), 2.7)
    assert plain > 5.0
    assert proposal.separation < 0.2 * plain


def test_identified_genes_do_not_adapt(hardening: InBeat) -> None:
    """Near resonance no gene fixed by the other frequencies imitates a hardening spring."""
    proposal, plain = apart(hardening, 2.3)
    assert plain > 5.0
    assert 0.5 * plain < proposal.separation <= plain
    assert proposal.resolves is not None
    assert proposal.resolves > 0.9


def test_a_repetition_costs_what_was_recorded(hardening: InBeat) -> None:
    number, best = hardening._repetitions()[0]
    recording = hardening.context.data.beat_recordings[number]
    assert best.details["recording"] == recording.name
    once = cost_of(recording)
    assert best.cost.seconds in (pytest.approx(once.seconds), pytest.approx(LONGER * once.seconds))
    step = recording.times[1] - recording.times[0]
    assert once.seconds == pytest.approx(len(recording.times) * step)
    assert once.frames == len(recording.times)


def test_what_was_recorded_is_compared_as_a_new_recording_would_be(hardening: InBeat) -> None:
    """The coefficients of the fits and a simulation of the same condition give the same separation."""
    data = hardening.context.data
    number = WIDE.index(2.0)
    again, _ = hardening.rivals.apart(hardening._recorded(number), 1.0 / 6.0)
    proposal, _ = apart(hardening, 2.0)
    assert np.sqrt(again[0, 1]) == pytest.approx(proposal.separation, rel=0.1)
    assert data.beat_recordings[number].condition.flap_frequency == 2.0


def test_a_recording_that_overloads_the_balance_is_not_proposed(
    hardening: InBeat, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert any(found for _, found in hardening._conditions())
    monkeypatch.setattr("wingfit.diagnosis.advice.in_beat.overloads", lambda *_: True)
    assert not any(found for _, found in hardening._conditions())
