"""Stated errors of the frame of tracks: what they change, and what a diagnosis sees beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.diagnosis.evidence.test_position_errors import described, diagnosed
from wingfit.diagnosis.evidence.frame_error import changes_by_frame, deviations, moved_by_frame
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.records import Dataset, FrameError

TURNED, SHIFTED = np.radians([0.3, -0.4, 0.35]), np.array([4e-4, -5e-4, 6e-4])
STATED = FrameError(tuple(np.radians([0.4, 0.4, 0.4])), (5e-4, 5e-4, 5e-4))


def in_wrong_frame(dataset: Dataset, turned: np.ndarray, shifted: np.ndarray, stated: FrameError | None) -> Dataset:
    """Return ``dataset`` with tracks in a frame that is wrong by ``turned`` (rad) and ``shifted`` (m)."""
    turn = Rotation.from_rotvec(turned).as_matrix()
    recordings = tuple(
        replace(one, values=(one.positions @ turn.T + shifted).reshape(one.values.shape)) for one in dataset.recordings
    )
    return replace(dataset, recordings=recordings, frame_error=stated)


def test_the_changes_are_those_of_a_frame_that_is_turned_and_shifted() -> None:
    dataset = described(0.0)
    data = WhitenedData.of(dataset.fitted)
    errors = np.concatenate([1e-4 * TURNED, 1e-4 * SHIFTED])
    moved = in_wrong_frame(dataset, errors[:3], errors[3:], None)
    change = np.concatenate(
        [
            fit.of(other.values - one.values)[fit.used].ravel()
            for fit, one, other in zip(data.beat_fits, dataset.fitted, moved.fitted, strict=True)
        ]
    )
    np.testing.assert_allclose(changes_by_frame(data) @ errors, change, atol=1e-3 * np.abs(change).max())
    one, fit = dataset.fitted[0], data.beat_fits[0]
    psi = 2 * np.pi * one.condition.flap_frequency * one.times
    seen = moved.fitted[0].values - one.values
    np.testing.assert_allclose(moved_by_frame(fit, psi, errors)[np.isfinite(seen)], seen[np.isfinite(seen)], atol=2e-7)
    np.testing.assert_array_equal(deviations(STATED)[3:], STATED.origin)


def test_a_frame_as_wrong_as_stated_hides_no_physics_and_is_not_blamed() -> None:
    dataset = described(0.0, "hinge_offset", {"hinge_offset.z": 0.006})
    finding = diagnosed(in_wrong_frame(dataset, TURNED, SHIFTED, STATED))
    assert (finding.verdict, finding.named) == ("named", ("hinge_offset",))
    offset = next(gene.value for gene in finding.genes if gene.name == "hinge_offset.z")
    assert offset.value == pytest.approx(0.006, abs=1e-3)
    assert finding.proof is not None
    assert finding.proof.after.value < 1.3
    assert any(one.startswith("the frame of the tracks is turned by") for one in finding.remarks)


def test_a_right_model_in_such_a_frame_is_adequate_and_only_if_the_error_is_stated() -> None:
    dataset = described(0.0)
    assert diagnosed(in_wrong_frame(dataset, TURNED, SHIFTED, STATED)).verdict == "adequate"
    unstated = diagnosed(in_wrong_frame(dataset, TURNED, SHIFTED, None))
    assert unstated.verdict != "adequate"


def test_a_frame_that_is_far_more_wrong_than_stated_is_named() -> None:
    stated = FrameError(tuple(np.radians([0.1, 0.1, 0.1])), (1e-4, 1e-4, 1e-4))
    finding = diagnosed(in_wrong_frame(described(0.0), np.zeros(3), np.array([0.0, 0.0, 4e-3]), stated))
    assert finding.named == ("camera_shift",)
    assert finding.verdict == "measurement fault"
    assert "39 times" in next(one for one in finding.remarks if "times its stated standard error" in one)
