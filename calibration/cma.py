"""CMA-ES (Hansen and Ostermeier 2001): DEAP's update of the distribution, draws and loop of ours.

Individuals live in the unit box; what is drawn outside is mirrored back. Every draw is keyed by seed, stage, generation
and slot, and the state is plain numbers, so a resumed search equals an uninterrupted one bit for bit.
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

SIGMA = 0.2  # unit coordinates: the start is an estimate, and the truth some tenths of the box away


@dataclass
class Distribution:
    """State of a search between generations, its own checkpoint.

    ``centroid``, ``paths``, ``covariance``, ``sigma`` and ``updates`` are those of the strategy; ``unit``, ``fitness``
    and ``distance`` the best individual so far; ``mean`` the mean fitness of those of the last generation that did not
    fail. ``generation``, ``stall`` and ``best`` as in :class:`wingfit.calibration.genetic.Population`.
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
        """A search that begins at ``start`` in unit coordinates."""
        zeros = [0.0] * len(start)
        return cls([float(u) for u in start], zeros, list(zeros), np.eye(len(start)).tolist(), unit=list(start))

    @property
    def diversity(self) -> float:
        """Mean over the genes of the standard deviation in unit coordinates."""
        return float(self.sigma * np.mean(np.sqrt(np.diag(np.array(self.covariance)))))


def drawn(state: Distribution, seed: int, stage: str, size: int) -> Array:
    """Unit coordinates [size, F] of the next generation; row 0 of the first generation is the start itself."""
    generation = state.generation + 1
    rows = []
    for slot in range(size):
        draw = random.Random(f"{seed}/{stage}/cma/{generation}/{slot}")  # noqa: S311  (a search, not a secret)
        rows.append([draw.gauss(0.0, 1.0) for _ in state.centroid])
    strategy = _strategy(state, size)
    unit = np.array(state.centroid) + state.sigma * np.array(rows) @ strategy.BD.T
    if generation == 0:
        unit[0] = state.centroid
    return np.array([[reflected(float(u)) for u in row] for row in unit])


def learnt(state: Distribution, unit: Array, fitness: Array, distance: Array, tolerance: float) -> Distribution:
    """The distribution updated with a generation ``unit`` [size, F] and its ``fitness`` and ``distance`` [size].

    If more than half of the individuals failed, the step size is halved and the rest of the distribution stays.
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
    """DEAP's strategy object for generations of ``size`` individuals, set to ``state``."""
    strategy = cma.Strategy(state.centroid, state.sigma, lambda_=size, cmatrix=np.array(state.covariance))
    strategy.ps, strategy.pc = np.array(state.step_path), np.array(state.path)
    strategy.update_count = state.updates
    return strategy
