"""A step of Gauss-Newton without damping goes to the minimum within the bounds, also with genes at their bounds."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.inference.gauss_newton import Quadratic
from wingfit.records.array_types import Array


def step(gram: Array, score: Array, unit: Array) -> Array:
    return Quadratic(gram, score).step(unit, np.zeros(len(unit)))


def test_within_bounds_it_is_newtons_step() -> None:
    gram, score = np.array([[4.0, 1.0], [1.0, 3.0]]), np.array([0.4, -0.3])
    move = step(gram, score, np.array([0.5, 0.5]))
    np.testing.assert_allclose(gram @ move, -score, atol=1e-14)


def test_genes_move_to_their_minimum_beside_one_that_stays_at_its_bound() -> None:
    """With the first gene free, the second would stay; as the first cannot move, the second must."""
    gram, score = np.array([[1.0, -0.9], [-0.9, 1.0]]), np.array([-0.5, 0.45])
    newton = -np.linalg.solve(gram, score)
    assert newton[0] > 0.4
    move = step(gram, score, np.array([1.0, 0.5]))
    np.testing.assert_allclose(move, [0.0, -0.45], atol=1e-14)


def test_a_gene_that_leaves_its_bounds_only_with_another_may_stay_within_them() -> None:
    """Unbounded, both genes leave above; with the first at its bound, the minimum of the second is below."""
    gram, score = np.array([[1.0, -0.9], [-0.9, 1.0]]), np.array([-0.5, 0.3])
    assert np.all(-np.linalg.solve(gram, score) > 0.5)
    np.testing.assert_allclose(step(gram, score, np.array([1.0, 0.5])), [0.0, -0.3], atol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_no_other_move_within_the_bounds_costs_less(seed: int) -> None:
    """The conditions of Karush, Kuhn and Tucker, with several genes at their bounds."""
    rng = np.random.default_rng(seed)
    slopes = rng.standard_normal((30, 6)) @ rng.standard_normal((6, 6))
    unit, score = rng.choice([0.0, 0.3, 0.7, 1.0], 6), 30.0 * rng.standard_normal(6)
    gram = slopes.T @ slopes + np.eye(6)
    move = step(gram, score, unit)
    there, gradient = unit + move, score + gram @ move
    free = np.abs(there - 0.5) < 0.5 - 1e-9
    assert np.all((there > -1e-12) & (there < 1.0 + 1e-12))
    np.testing.assert_allclose(gradient[free], 0.0, atol=1e-8 * np.abs(score).max())
    assert np.all(gradient[~free & (there < 0.5)] > -1e-8)
    assert np.all(gradient[~free & (there > 0.5)] < 1e-8)
    assert not free.all()
