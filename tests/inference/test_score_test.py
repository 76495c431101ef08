"""Score tests against full least squares: what an addition removes once the nuisance genes have adapted."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.inference.score_test import Nuisance, amounts, explained, remaining, spread

RNG = np.random.default_rng(4)
SLOPES, FIELDS, RESIDUAL = RNG.standard_normal((60, 4)), RNG.standard_normal((2, 60)), RNG.standard_normal(60)
FREE = (np.full(2, -np.inf), np.full(2, np.inf))


def left_by(*columns: npt.NDArray[np.float64]) -> float:
    """Sum of squares that least squares with these columns leaves."""
    matrix = np.column_stack(columns)
    return float(np.sum((RESIDUAL - matrix @ np.linalg.lstsq(matrix, RESIDUAL, rcond=None)[0]) ** 2))


def test_the_gain_is_that_of_a_joint_least_squares_fit() -> None:
    nuisance = Nuisance.of(SLOPES)
    own, left = nuisance.rest(FIELDS), nuisance.rest(RESIDUAL)
    expected = left_by(SLOPES) - left_by(SLOPES, FIELDS.T)
    assert explained(own, left) == pytest.approx(expected)
    multiples = amounts(own, left, FREE, 0.0)
    assert float(left @ left) - remaining(own, left, multiples) == pytest.approx(expected)


def test_what_the_nuisance_genes_can_do_explains_nothing_and_dependent_genes_count_once() -> None:
    nuisance = Nuisance.of(np.column_stack([SLOPES, SLOPES[:, 0] - SLOPES[:, 1]]))
    assert nuisance.basis.shape[1] == 4
    inside = nuisance.rest(SLOPES[:, 2])
    assert np.abs(inside).max() < 1e-12
    assert amounts(inside[None], RESIDUAL, (np.array([-1.0]), np.array([1.0])), 1e-9).tolist() == [0.0]


def test_shorter_vectors_count_as_zero_beyond_their_end() -> None:
    nuisance = Nuisance.of(SLOPES)
    whole = np.concatenate([RESIDUAL[:50], np.zeros(10)])
    np.testing.assert_allclose(nuisance.rest(RESIDUAL[:50]), nuisance.rest(whole))


def test_limits_clip_a_single_multiple_and_scale_several() -> None:
    best = amounts(FIELDS, RESIDUAL, FREE, 0.0)
    half = np.abs(best) / 2.0
    np.testing.assert_allclose(amounts(FIELDS, RESIDUAL, (-half, half), 0.0), best / 2.0)
    alone = amounts(FIELDS[:1], RESIDUAL, (np.array([0.0]), np.array([0.0])), 0.0)
    assert alone.tolist() == [0.0]


def test_places_fill_the_box_and_are_always_the_same() -> None:
    points = spread(32, 2)
    assert points.shape == (32, 2)
    quarters = np.bincount((points > 0.5) @ np.array([1, 2]), minlength=4)
    assert np.all(np.abs(quarters - 8) <= 2)
    np.testing.assert_array_equal(points, spread(32, 2))
