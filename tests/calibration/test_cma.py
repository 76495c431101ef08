from __future__ import annotations

import json

import numpy as np
import pytest
from deap import cma

from wingfit.calibration.cma import Distribution, drawn, learnt
from wingfit.calibration.genetic import FAILED, Individual


def valley(unit: np.ndarray, bottom: float = 0.3) -> np.ndarray:
    """A narrow oblique valley, as two stiffnesses that compensate each other make."""
    x = unit - bottom
    return np.asarray(1e-6 + x.sum(axis=1) ** 2 * 1e3 + (x**2).sum(axis=1))


def search(
    generations: int, now: Distribution | None = None, seed: int = 1, size: int = 16, bottom: float = 0.3
) -> Distribution:
    now = now or Distribution.about([0.5] * 5)
    while now.generation + 1 < generations:
        unit = drawn(now, seed, "test", size)
        fitness = valley(unit, bottom)
        now = learnt(now, unit, fitness, np.sqrt(fitness), 1e-3)
    return now


def test_finds_the_bottom_of_an_oblique_valley() -> None:
    end = search(120)
    np.testing.assert_allclose(end.unit, 0.3, atol=1e-3)
    assert end.fitness == pytest.approx(valley(np.array([end.unit]))[0])
    assert end.diversity < 1e-2


def test_finds_a_bottom_in_the_corner_of_the_box() -> None:
    end = search(150, bottom=0.0)
    np.testing.assert_allclose(end.unit, 0.0, atol=0.02)


@pytest.mark.parametrize("cut", [0, 1, 7])
def test_resumed_equals_uninterrupted_bit_for_bit(cut: int) -> None:
    whole = search(30)
    part = Distribution(**json.loads(json.dumps(vars(search(cut)), allow_nan=False)))
    np.random.seed(999)  # whatever else drew in between
    assert search(30, part) == whole


def test_the_distribution_follows_deaps_own_loop() -> None:
    """Nothing of the strategy's state is lost between generations."""
    now, strategy = Distribution.about([0.9] * 4), cma.Strategy([0.9] * 4, 0.02, lambda_=12)
    now.sigma = 0.02  # small steps downhill: the path grows long
    for _ in range(12):
        unit = drawn(now, 1, "test", 12)
        fitness = valley(unit)
        now = learnt(now, unit, fitness, np.sqrt(fitness), 1e-3)
        strategy.update([Individual(row, score) for row, score in zip(unit.tolist(), fitness.tolist(), strict=True)])
        np.testing.assert_allclose(now.centroid, strategy.centroid, rtol=1e-12)
        np.testing.assert_allclose(now.covariance, strategy.C, rtol=1e-12)
        assert now.sigma == pytest.approx(strategy.sigma, rel=1e-12)


def test_seeds_differ_and_repeat() -> None:
    assert search(3) == search(3)
    assert search(3).centroid != search(3, seed=2).centroid


def test_draws_stay_in_the_box_and_begin_with_the_start() -> None:
    wide = Distribution.about([0.02, 0.5, 0.99])
    unit = drawn(wide, 1, "test", 40)
    assert ((unit >= 0) & (unit <= 1)).all()
    assert unit[0].tolist() == [0.02, 0.5, 0.99]
    assert np.std(unit[:, 1]) == pytest.approx(0.2, rel=0.3)


def test_failures_rank_last_and_a_failed_generation_only_narrows() -> None:
    now = Distribution.about([0.5, 0.5])
    unit = drawn(now, 1, "test", 12)
    some = valley(unit)
    some[3:6] = np.inf
    after = learnt(now, unit, some, np.sqrt(some), 1e-3)
    assert after.fitness == some[np.isfinite(some)].min()
    assert np.isfinite(after.centroid).all()
    assert after.mean == pytest.approx(some[np.isfinite(some)].mean())
    none = learnt(now, unit, np.full(12, np.inf), np.full(12, np.inf), 1e-3)
    assert none.fitness == FAILED
    assert none.centroid == now.centroid
    assert none.sigma == 0.5 * now.sigma
    assert none.stall == 1
