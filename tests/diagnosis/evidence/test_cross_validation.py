"""How far genes move where an experiment is left out: to the minimum, within their bounds."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from wingfit.diagnosis.evidence.refit import _move_within_bounds


def test_within_bounds_it_is_newtons_step() -> None:
    gram, score = np.array([[4.0, 1.0], [1.0, 3.0]]), np.array([0.4, -0.3])
    move = _move_within_bounds(gram, score, np.array([0.5, 0.5]))
    np.testing.assert_allclose(gram @ move, -score, atol=1e-14)


def test_genes_move_to_their_minimum_beside_one_that_stays_at_its_bound() -> None:
    """With the first gene free, the second would stay; as the first cannot move, the second does what is left to do."""
    gram, score = np.array([[1.0, -0.9], [-0.9, 1.0]]), np.array([-0.5, 0.45])
    newton = -np.linalg.solve(gram, score)
    assert newton[0] > 0.4
    move = _move_within_bounds(gram, score, np.array([1.0, 0.5]))
    np.testing.assert_allclose(move, [0.0, -0.45], atol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_the_minimum_is_that_of_a_bounded_least_squares_problem(seed: int) -> None:
    """Where one gene leaves its bounds, against another algorithm."""
    rng = np.random.default_rng(seed)
    slopes, unit = rng.standard_normal((30, 4)), np.array([0.98, 0.5, 0.5, 0.5])
    residual = slopes @ np.array([-0.3, *rng.uniform(-0.1, 0.1, 3)]) + 0.01 * rng.standard_normal(30)
    move = _move_within_bounds(slopes.T @ slopes, slopes.T @ residual, unit)
    best = scipy.optimize.lsq_linear(slopes, -residual, (-unit, 1.0 - unit), tol=1e-14)
    np.testing.assert_allclose(move, best.x, atol=1e-6)
    assert unit[0] + move[0] == 1.0
