"""Intervals of genes: errors of rest positions that move all markers alike, and recordings that disagree."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from tests.diagnosis.evidence.test_position_errors import HAND, SPEC, described
from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit
from wingfit.diagnosis.evidence.frame_error import changes_by_frame
from wingfit.diagnosis.evidence.intervals import covariance
from wingfit.diagnosis.evidence.intervals import freedom as degrees_of_freedom
from wingfit.diagnosis.evidence.position_errors import _own, _rigid, changes_by_errors
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.rigs import subject_of
from wingfit.inference.marginal import Marginal
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import robird_wing

BOX = 0.02  # m, width of the bounds of a shift of the cameras
DRAWS = 600


@pytest.fixture(scope="module")
def data() -> WhitenedData:
    return WhitenedData.of(described(0.0).recordings[:-1])


def fitted(coefficients: Array, slopes: Array) -> Fit:
    """A linear model with ``slopes`` [D, F] whose fit leaves ``coefficients`` [D]."""
    unit = np.full(slopes.shape[1], 0.5)
    return cast("Fit", SimpleNamespace(unit=unit, coefficients=coefficients, jacobian=slopes))


def test_the_interval_of_a_shift_of_the_cameras_includes_errors_of_the_rest_positions(data: WhitenedData) -> None:
    """Against fits to drawn errors of all markers and drawn noise.

    The errors that a rigid wing shares move a shift far more than the noise, and more than those of single markers.
    """
    dataset = described(0.0)
    markers = robird_wing().markers
    rest = np.array([m.position[:2] for m in markers])
    usual, still = np.ones(len(markers), bool), [np.zeros_like(one.values) for one in data.beat_recordings]
    changes = changes_by_errors(subject_of(dataset, SPEC), data, still, [m.name for m in markers])
    own, rigid = (HAND * one(changes, rest, usual) for one in (_own, _rigid))
    allowing = data.allowing(Marginal.of(own / data.scale[:, None]), rigid)
    slopes = allowing.without_errors(BOX * changes_by_frame(data)[:, 3:].T).T
    white, rng = slopes / data.scale[:, None], np.random.default_rng(5)
    weight, found = data.max_likelihood_weight, []
    gain = np.linalg.solve(weight * white.T @ white + np.eye(3) / PRIOR_SD**2, weight * white.T)
    for _ in range(DRAWS):
        errors = HAND * rng.standard_normal(changes.shape[1])
        drawn = changes @ errors + np.sqrt(data.variance) * rng.standard_normal(len(data.scale))
        found.append(gain @ (allowing.without_errors(drawn) / data.scale))
    stated = np.sqrt(np.diag(covariance(allowing, fitted(np.zeros(len(data.scale)), slopes))))
    np.testing.assert_allclose(stated, np.std(found, axis=0), rtol=0.15)
    assert BOX * stated.max() > HAND / np.sqrt(len(markers))


def test_recordings_that_disagree_on_a_gene_widen_its_interval(data: WhitenedData) -> None:
    """Of recordings that know a gene alike, the squared standard error of the mean of their own estimates."""
    rng = np.random.default_rng(6)
    slopes, left = np.zeros((len(data.scale), 1)), np.zeros(len(data.scale))
    apart = np.array([-0.02, -0.01, 0.03])
    for part, one in zip(data.recording_slices, apart, strict=True):
        way = rng.standard_normal(part.stop - part.start)
        slopes[part, 0] = 3000.0 * data.scale[part] * way / np.linalg.norm(way)
        left[part] = one * slopes[part, 0]
    weight = data.likelihood_weight(left)
    assert weight < 0.1
    alike = 1.0 / (weight * 3 * 3000.0**2 + PRIOR_SD**-2)
    by_recording = (1.0 - weight) * np.var(apart, ddof=1) / 3
    assert by_recording > 0.5 * alike
    fit = fitted(left, slopes)
    total = covariance(data, fit)
    assert total[0, 0] == pytest.approx(alike + by_recording, rel=1e-2)
    freedom = degrees_of_freedom(data, fit, np.diag(total))
    assert freedom == pytest.approx([2 * ((alike + by_recording) / by_recording) ** 2], rel=0.03), "Satterthwaite"
