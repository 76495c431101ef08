"""Information, optimal designs and powers of tests against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from wingfit.inference.design import (
    Information,
    after_fit,
    cosine,
    detectable_distance,
    detection_probability,
    greedy_exchange,
    log_determinant,
    odds_probability,
    separable_distance,
    squared_distance,
)
from wingfit.records.array_types import Array


def test_white_noise_gives_the_covariance_of_least_squares() -> None:
    slopes = np.random.default_rng(1).standard_normal((40, 3))
    found = Information.of(slopes, np.ones(40)).covariance(np.zeros(3))
    np.testing.assert_allclose(found, np.linalg.inv(slopes.T @ slopes), rtol=1e-12)


def test_the_sandwich_is_the_scatter_of_least_squares_under_any_noise() -> None:
    rng = np.random.default_rng(2)
    slopes, variance, shared = rng.standard_normal((30, 2)), rng.uniform(0.5, 3.0, 30), rng.standard_normal((30, 2))
    zero, weight = np.ones((30, 1)), rng.uniform(0.5, 2.0, 30)
    info = Information.of(slopes, variance, shared, None, weight, zero)
    fit = np.linalg.solve(slopes.T @ (weight[:, None] * slopes), slopes.T * weight)
    noise = np.diag(variance) + shared @ shared.T + zero @ zero.T
    np.testing.assert_allclose(info.covariance(np.zeros(2)), fit @ noise @ fit.T, rtol=1e-10)
    np.testing.assert_allclose(info.true, slopes.T @ np.linalg.solve(noise, slopes), rtol=1e-10)


def test_more_samples_average_noise_but_not_a_wrong_zero() -> None:
    slopes, zero = np.ones((10, 1)), 0.3 * np.ones((10, 1))
    info = Information.of(slopes, np.full(10, 4.0), constant=zero)
    for factor in (1.0, 5.0):
        assert info.times(factor).covariance(np.zeros(1))[0, 0] == pytest.approx(0.4 / factor + 0.09)


def test_a_shift_that_is_estimated_from_the_samples_costs_their_noise_along_it() -> None:
    """With the offset of a mean, residuals are about the mean: what is constant is not seen, and scatters nothing."""
    count = 12
    slopes = np.column_stack([np.ones(count), np.linspace(-1.0, 1.0, count)])
    info = Information.of(slopes, np.ones(count), shift=(np.ones(count), -np.full(count, 1.0 / count)))
    assert info.scores[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert info.scores[1, 1] == pytest.approx(float(slopes[:, 1] @ slopes[:, 1]))
    assert info.true[0, 0] == pytest.approx(0.0, abs=1e-6)


def test_d_optimal_points_of_a_parabola_are_its_ends_and_its_middle() -> None:
    """Fedorov (1972): equal weights at -1, 0 and 1, whatever the candidates between them."""
    x = np.linspace(-1.0, 1.0, 21)
    rows = np.column_stack([np.ones(21), x, x**2])

    def score(chosen: object) -> float:
        part = rows[list(chosen)]  # type: ignore[call-overload]
        return log_determinant(part.T @ part + 1e-6 * np.eye(3))

    chosen = greedy_exchange(score, 21, 6)
    np.testing.assert_allclose(sorted(x[chosen]), [-1.0, -1.0, 0.0, 0.0, 1.0, 1.0], atol=1e-12)
    assert greedy_exchange(score, 21, 0) == []


def test_genes_that_imitate_an_effect_hide_it() -> None:
    changes = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    rest = after_fit(changes.T @ changes, np.array([0]), np.zeros(1))
    assert squared_distance(rest, 1, np.empty(0, int)) == pytest.approx(1.0)
    assert squared_distance(rest, 1, np.array([2])) == pytest.approx(0.0, abs=1e-8)
    assert cosine(rest, 1, np.array([2])) == pytest.approx(1.0)
    hidden = after_fit(changes.T @ changes, np.array([1]), np.zeros(1))
    assert squared_distance(hidden, 0, np.array([2])) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("freedom", [1, 4])
def test_the_detectable_distance_is_detected_with_its_power(freedom: int) -> None:
    distance = detectable_distance(freedom, 0.01, 0.9)
    assert detection_probability(distance, freedom, 0.01) == pytest.approx(0.9, abs=1e-6)
    rng = np.random.default_rng(3)
    samples: Array = rng.standard_normal((40_000, freedom))
    samples[:, 0] += np.sqrt(distance)
    quiet = np.sort((rng.standard_normal((400_000, freedom)) ** 2).sum(axis=1))
    assert ((samples**2).sum(axis=1) > quiet[int(0.99 * len(quiet))]).mean() == pytest.approx(0.9, abs=0.01)


def test_the_odds_of_two_means_are_those_of_normal_likelihoods() -> None:
    distance = separable_distance(20.0, 0.8)
    assert odds_probability(distance, 20.0) == pytest.approx(0.8)
    x = np.random.default_rng(4).standard_normal(100_000) + np.sqrt(distance)
    odds = norm.logpdf(x, np.sqrt(distance)) - norm.logpdf(x)
    assert (odds > np.log(20.0)).mean() == pytest.approx(0.8, abs=0.01)
    assert odds_probability(0.0, 20.0) == 0.0
