"""The search CMA-ES (Hansen and Ostermeier 2001): DEAP updates the distribution; draws and loop are written here.

Individuals are points of the unit box: genes are scaled so that their bounds are 0 and 1; a draw outside is mirrored at
the bound. The random generator of each draw is seeded with the seed, stage, generation and number of the individual,
and the state is plain numbers. So a resumed search equals an uninterrupted one bit for bit.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from deap import cma

from wingfit.calibration.genetic import FAILED, Individual, finite, reflected
from wingfit.records.array_types import Array

SIGMA = 0.2  # initial step size, genes scaled to 0..1: the true values are some tenths away from the estimates


@dataclass
class Distribution:
    """State of a CMA-ES search after a generation; its fields are plain numbers and are stored as the checkpoint.

    ``centroid`` [F], ``step_path`` [F], ``path`` [F], ``covariance`` [F, F], ``sigma`` (step size) and ``updates`` are
    those of DEAP's strategy, for F free genes. ``unit`` [F] (genes scaled to 0..1), ``fitness`` and ``distance`` are
    those of the best individual so far; ``mean`` is the last generation's mean fitness, without failed individuals.
    ``generation``, ``stall`` and ``best`` are as in :class:`wingfit.calibration.genetic.Population`.
    """

    centroid: list[float] = field(default_factory=list)
    step_path: list[float] = field(default_factory=list)
    path: list[float] = field(default_factory=list)
    covariance: list[list[float]] = field(default_factory=list)
    sigma: float = SIGMA
    updates: int = 0
    unit: list[float] = field(default_factory=list)
    fitness: float = FAILED
    distance: float = FAILED
    mean: float = FAILED
    generation: int = -1
    stall: int = 0
    best: float = FAILED

    @classmethod
    def about(cls, start: Sequence[float]) -> Distribution:
        """Return the initial state of a search from ``start`` [F], genes scaled to 0..1."""
        zeros = [0.0] * len(start)
        return cls([float(u) for u in start], zeros, list(zeros), np.eye(len(start)).tolist(), unit=list(start))

    @property
    def diversity(self) -> float:
        """Standard deviation of the distribution (genes scaled to 0..1), mean over the genes."""
        return float(self.sigma * np.mean(np.sqrt(np.diag(np.array(self.covariance)))))


def drawn(state: Distribution, seed: int, stage: str, size: int) -> Array:
    """Draw the next generation [size, F], genes scaled to 0..1; row 0 of the first generation is the start itself."""
    generation = state.generation + 1
    rows = []
    for slot in range(size):
        draw = random.Random(f"{seed}/{stage}/cma/{generation}/{slot}")  # noqa: S311  (a search, not a secret)
        rows.append([draw.gauss(0.0, 1.0) for _ in state.centroid])
    strategy = _strategy(state, size)
    # By the symmetric root of the covariance: eigenvectors alone depend, in sign and order, on the library of algebra.
    unit = np.array(state.centroid) + state.sigma * np.array(rows) @ (strategy.B @ strategy.BD.T)
    if generation == 0:
        unit[0] = state.centroid
    return np.array([[reflected(float(u)) for u in row] for row in unit])


def learnt(state: Distribution, unit: Array, fitness: Array, distance: Array, tolerance: float) -> Distribution:
    """Return ``state`` updated with a generation ``unit`` [size, F] and its ``fitness`` and ``distance`` [size].

    ``tolerance`` is the relative decrease of the best fitness that resets ``stall``. If more than half of the
    individuals failed, the step size is halved and the rest of the distribution is unchanged.
    """
    scores = [finite(f) for f in fitness]
    good = [f for f in scores if f < FAILED]
    first = int(np.argmin(scores))
    found = scores[first] < state.fitness
    best = min(scores[first], state.fitness)
    improved = best < state.best * (1.0 - tolerance)
    after = Distribution(**state.__dict__)
    after.generation, after.mean = state.generation + 1, float(np.mean(good)) if good else FAILED
    after.stall, after.best = (0, best) if improved else (state.stall + 1, state.best)
    if found:
        after.unit, after.fitness = [float(u) for u in unit[first]], scores[first]
        after.distance = finite(float(distance[first]))
    if 2 * len(good) < len(unit):
        after.sigma = 0.5 * state.sigma
        return after
    strategy = _strategy(state, len(unit))
    strategy.update([Individual(row, score) for row, score in zip(unit.tolist(), scores, strict=True)])
    after.centroid, after.covariance = strategy.centroid.tolist(), strategy.C.tolist()
    after.step_path, after.path = strategy.ps.tolist(), strategy.pc.tolist()
    after.sigma, after.updates = float(strategy.sigma), strategy.update_count
    return after


def _strategy(state: Distribution, size: int) -> Any:
    """Make DEAP's strategy object for generations of ``size`` individuals and set it to ``state``."""
    strategy = cma.Strategy(state.centroid, state.sigma, lambda_=size, cmatrix=np.array(state.covariance))
    strategy.ps, strategy.pc = np.array(state.step_path), np.array(state.path)
    strategy.update_count = state.updates
    return strategy
