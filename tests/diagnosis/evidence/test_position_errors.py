"""Errors of hand-measured rest positions: their axes, their size, and what a diagnosis sees beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from wingfit.calibration.problem import base_genome
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis import DiagnosisSpec, Finding, diagnose
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import gauss_newton_fit
from wingfit.diagnosis.evidence.position_errors import PositionErrors, _own, axes_at_markers, find_position_errors
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.policy import POLICY
from wingfit.diagnosis.rigs import subject_of
from wingfit.records import Dataset, Recording, Wing
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import REFERENCE, Tracking, blank_recording, record, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers.in_process import InProcessEvaluator

SPEC = CalibrationSpec(division="4")
CONDITIONS = (vacuum(10.0, 0.05, 3.0), vacuum(1000.0, 0.12, 2.5), tunnel(0.05, 3.5, 6.0))
HELD_OUT = tunnel(0.0, 3.0, 4.0)
HAND = 7e-4  # m


def displaced(wing: Wing, by: Array) -> Wing:
    """``wing`` whose description has its markers off by ``by`` [M, 3] (m)."""
    places = [(np.array(one.position) + move).tolist() for one, move in zip(wing.markers, by, strict=True)]
    return replace(
        wing, markers=tuple(replace(m, position=tuple(p)) for m, p in zip(wing.markers, places, strict=True))
    )


def described(
    deviation: float,
    effect: str = "",
    sizes: Mapping[str, float] | None = None,
    tracking: Tracking = Tracking(),  # noqa: B008
) -> Dataset:
    """Recordings of a wing with ``effect`` of ``sizes``, and a description with positions off by ``deviation`` (m)."""
    model = FlexibleWing(robird_wing(), "4", numerics=REFERENCE)
    model = model.with_effects(effect) if effect else model
    truth = base_genome(model, sizes or {})
    found = [
        replace(record(model, truth, one, tracking, np.random.default_rng(k)), name=f"recording-{k}")
        for k, one in enumerate((*CONDITIONS, HELD_OUT))
    ]
    by = deviation * np.random.default_rng(11).standard_normal((len(model.wing.markers), 3))
    return Dataset("wing", displaced(model.wing, by), tuple(found), (found[-1].name,))


def diagnosed(dataset: Dataset) -> Finding:
    suspects = ("hinge_offset", "camera_shift", "stroke_amplitude", "damage")
    *_, last = diagnose(dataset, DiagnosisSpec(SPEC, suspects=suspects), InProcessEvaluator())
    assert last.finding is not None
    return last.finding


def test_the_axes_turn_with_the_wing() -> None:
    """Against a simulation whose described markers are all displaced, which moves each along its axes."""
    wing, step = robird_wing(), 1e-3
    times = np.arange(60) * 31 / 30 / 3.0
    blank = replace(blank_recording(wing, CONDITIONS[0], frames=60), times=times, values=np.full((60, 147), np.nan))

    def seen(by: Array, recording: Recording) -> Array:
        model = FlexibleWing(displaced(wing, np.tile(by, (len(wing.markers), 1))), "16x1")
        genome = np.array([[gene.nominal for gene in model.genes]])
        return np.asarray(model.observe(genome, recording).channels[0])

    first = seen(np.zeros(3), blank)
    own = replace(blank, values=first + 1e-5 * np.random.default_rng(1).standard_normal(first.shape))
    others = [seen(by, own) for by in step * np.eye(3)]
    subject = subject_of(Dataset("wing", wing, (own,)), SPEC)
    data = WhitenedData.of([own])
    axes = axes_at_markers(subject, own, data.beat_fits[0], np.zeros_like(first))
    for k, other in enumerate(others):
        change = data.beat_fits[0].of((other - first) / step).reshape(-1, 3, axes.shape[-1])
        error = np.sqrt(np.mean((axes[:, k] - change) ** 2) / np.mean(change**2))
        assert error < 0.1, k


def measured(dataset: Dataset) -> tuple[PositionErrors, WhitenedData] | None:
    subject, fitted = subject_of(dataset, SPEC), dataset.recordings[:-1]
    context = FitContext(subject, WhitenedData.of(fitted), InProcessEvaluator())
    problem = context.problem(subject.model, tuple(subject.model.searched), base_genome(subject.model, {}))
    *_, nominal = gauss_newton_fit(context, problem, np.full(len(problem.free), 0.5), 4)
    return find_position_errors(subject, context.data, nominal)


def test_their_size_is_measured_and_exact_positions_have_none() -> None:
    assert measured(described(0.0)) is None
    found = measured(described(HAND))
    assert found is not None
    assert found[0].sd == pytest.approx(HAND, rel=0.12)


def test_chance_in_what_they_share_explains_itself_but_nothing_else_nor_without_limit() -> None:
    """Against draws of the nine rigid motions of the errors."""
    found = measured(described(HAND))
    assert found is not None
    errors, data = found
    assert data.rigid_errors is not None
    rng = np.random.default_rng(5)
    draws = rng.standard_normal((2000, data.rigid_errors.shape[1])) @ data.rigid_errors.T
    squares = (data.weight * draws**2).sum(axis=1)
    assert np.sqrt(squares.mean()) == pytest.approx(errors.shared, rel=0.1)
    by_chance = np.array([data.excess_by_chance(one) for one in draws[:200]])
    expected = np.maximum(squares[:200] - squares.mean(), 0.0)
    np.testing.assert_allclose(by_chance, expected, atol=0.05 * squares.mean())
    assert data.excess_by_chance(10.0 * draws[0]) == pytest.approx(POLICY.refuting_excess * squares.std(), rel=0.1)
    other = data.scale * rng.standard_normal(len(data.scale))
    other *= 2.0 * errors.shared / np.sqrt(data.weight @ other**2)
    assert data.excess_by_chance(other) == 0.0


def test_what_a_rigid_wing_does_is_not_taken_for_errors_beside_markers_that_slipped() -> None:
    rest, rng = np.array([m.position[:2] for m in robird_wing().markers]), np.random.default_rng(3)
    changes, usual = rng.standard_normal((400, 147)), np.arange(49) % 16 != 2
    own = _own(changes, rest, usual).reshape(400, 49, 3)
    assert not own[:, ~usual].any()
    for rigid in (np.ones(49), rest[:, 0], rest[:, 1]):
        np.testing.assert_allclose(np.einsum("dma,m->da", own, rigid * usual), 0.0, atol=1e-9)


def test_a_hinge_offset_is_named_although_the_positions_were_measured_by_hand() -> None:
    finding = diagnosed(described(HAND, "hinge_offset", {"hinge_offset.z": 0.004}))
    assert (finding.verdict, finding.named) == ("named", ("hinge_offset",))
    offset = next(gene.value for gene in finding.genes if gene.name == "hinge_offset.z")
    assert offset.value == pytest.approx(0.004, abs=1e-3)
    assert any(one.startswith("the described rest positions of the markers are wrong by") for one in finding.remarks)
    assert finding.proof is not None
    assert finding.proof.after.value < 1.6
    assert finding.floors.marker_positions == pytest.approx(HAND * np.sqrt(3 / 49), rel=0.2)


def test_a_right_model_stays_adequate() -> None:
    finding = diagnosed(described(HAND))
    assert finding.verdict == "adequate"
    assert finding.probabilities["adequate"] > 0.9
