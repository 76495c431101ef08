"""Nuisance parameters with normal priors, against the closed forms of linear regression."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.inference.marginal import Marginal

RNG = np.random.default_rng(4)
CHANGES = RNG.standard_normal((40, 3)) * [10.0, 1.0, 0.01]


def test_whitened_residuals_have_unit_covariance_for_any_size_of_the_parameters() -> None:
    """W (1 + A A^T) W^T = 1."""
    whitener = Marginal.of(CHANGES).whiten(np.eye(40)).T
    covariance = np.eye(40) + CHANGES @ CHANGES.T
    np.testing.assert_allclose(whitener @ covariance @ whitener.T, np.eye(40), atol=1e-10)


def test_the_estimates_are_those_of_ridge_regression() -> None:
    residual = RNG.standard_normal(40) + CHANGES @ [0.5, -1.0, 2.0]
    marginal = Marginal.of(CHANGES)
    expected = np.linalg.solve(CHANGES.T @ CHANGES + np.eye(3), CHANGES.T @ residual)
    np.testing.assert_allclose(marginal.estimates(marginal.whiten(residual)), expected, rtol=1e-9)


def test_what_was_whitened_is_restored_and_a_part_has_its_own_covariance() -> None:
    marginal, residuals, part = Marginal.of(CHANGES), RNG.standard_normal((5, 40)), slice(10, 25)
    np.testing.assert_allclose(marginal.restore(marginal.whiten(residuals)), residuals, atol=1e-9)
    whitener = marginal.of_part(part).whiten(np.eye(15)).T
    covariance = np.eye(15) + CHANGES[part] @ CHANGES[part].T
    np.testing.assert_allclose(whitener @ covariance @ whitener.T, np.eye(15), atol=1e-9)


def test_a_parameter_that_changes_nothing_is_estimated_as_zero() -> None:
    marginal = Marginal.of(np.column_stack([CHANGES[:, 0], np.zeros(40)]))
    first, second = marginal.estimates(marginal.whiten(CHANGES[:, 0]))
    assert first == pytest.approx(1.0, rel=0.01)
    assert second == 0.0
    np.testing.assert_array_equal(Marginal.of(np.zeros((40, 2))).whiten(CHANGES.T), CHANGES.T)
