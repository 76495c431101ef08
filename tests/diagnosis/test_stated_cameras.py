"""Faults in the images of stated cameras, concealed in simulated tracks and diagnosed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.evidence.test_position_errors import described
from tests.records.samples import falcon_cameras
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis import DiagnosisSpec, diagnose
from wingfit.diagnosis.rigs import subject_of
from wingfit.records import Dataset
from wingfit.records.array_types import Array
from wingfit.workers.in_process import InProcessEvaluator

K1 = -0.2
PLACES = ("x", "y", "distance", "base")


def through_lenses(points: Array, k1: float) -> Array:
    """Points [..., 3] as cameras see them through a barrel that is not calibrated, by linear triangulation."""
    rows, sides = [], []
    for camera in falcon_cameras():
        axes, centre = np.array(camera.rotation), np.array(camera.centre)
        local = (points - centre) @ axes.T
        image = local[..., :2] / local[..., 2:]
        image = image * (1 + k1 * (image * image).sum(-1, keepdims=True))
        for k in range(2):
            row = axes[k] - image[..., k : k + 1] * axes[2]
            rows.append(row)
            sides.append(row @ centre)
    a, b = np.stack(rows, axis=-2), np.stack(sides, axis=-1)
    right = np.einsum("...ri,...r->...i", a, b)[..., None]
    return np.asarray(np.linalg.solve(np.swapaxes(a, -1, -2) @ a, right)[..., 0])


def distorted(dataset: Dataset) -> Dataset:
    recordings = tuple(
        replace(one, values=through_lenses(one.positions, K1).reshape(one.values.shape)) for one in dataset.recordings
    )
    return replace(dataset, recordings=recordings, cameras=falcon_cameras())


def test_a_distortion_that_the_calibration_leaves_out_is_named_with_its_size() -> None:
    spec = DiagnosisSpec(CalibrationSpec(division="4"), suspects=("lens_distortion", "scale_error", "hinge_offset"))
    *_, last = diagnose(distorted(described(0.0)), spec, InProcessEvaluator())
    finding = last.finding
    assert finding is not None
    assert finding.named == ("lens_distortion",)
    assert finding.verdict == "measurement fault"
    k1 = next(gene.value for gene in finding.genes if gene.name == "lens_distortion.k1")
    assert k1.value == pytest.approx(K1, abs=0.05)
    assert finding.proof is not None
    assert finding.proof.after.value < 1.3


def test_suspects_have_no_places_for_stated_cameras_and_have_them_without() -> None:
    dataset = described(0.0)
    for cameras, places in ((falcon_cameras(), ()), ((), PLACES)):
        suspects = subject_of(replace(dataset, cameras=cameras), CalibrationSpec(division="4")).suspects
        (lens,) = (one for one in suspects if one.name == "lens_distortion")
        assert [gene.name for gene in lens.genes] == [f"lens_distortion.{p}" for p in ("k1", "k2", "p1", "p2", *places)]
        assert set(lens.typical) == {gene.name for gene in lens.genes}
