"""The genetic search of van der Grinten's thesis (IV): DEAP's operators, and a loop that is written here.

Individuals are points of the unit box: genes are scaled so that their bounds are 0 and 1. The random generator of each
individual is seeded with the seed, stage, generation and its number, so a resumed search equals an uninterrupted one
bit for bit. DEAP draws from Python's global generator; under a lock, its state is replaced for each child and restored
afterwards, so that searches in other threads neither see nor change it.
"""

from __future__ import annotations

import random
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from deap import base, tools

from wingfit.records.array_types import Array

_LOCK = threading.Lock()

TOURNAMENT = 3
DIFFERENTIAL, BLEND = 0.6, 0.3  # fractions of children by crossover; the rest are mutations
DIFFERENCE_SCALE = (0.3, 0.9)
BLEND_ALPHA = 0.4
MUTATION_ETA = 20.0
FAILED = 1e300  # stands for an infinite misfit in checkpoints, JSON having no infinity


class _Fitness(base.Fitness):  # type: ignore[misc]
    weights = (-1.0,)


class Individual(list[float]):
    """An individual as DEAP needs it: genes scaled to 0..1 as a list, and a fitness (invalid if None)."""

    def __init__(self, u: Sequence[float], fitness: float | None = None) -> None:
        super().__init__(u)
        self.fitness = _Fitness(() if fitness is None else (fitness,))


@dataclass
class Population:
    """State of a genetic search after a generation; its fields are plain numbers and are stored as the checkpoint.

    Attributes:
        unit: individuals with genes scaled to 0..1, best first.
        fitness: sum of squares of each individual, m^2 or N^2 (FAILED for one that failed).
        distance: of each individual, mean distance per marker (m) or RMS difference of forces (N).
        generation: number of this generation, from 0; -1 before the first.
        stall: generations since the best fitness last improved.
        best: best fitness at the last improvement by more than the tolerance; the next one is relative to it.
    """

    unit: list[list[float]] = field(default_factory=list)
    fitness: list[float] = field(default_factory=list)
    distance: list[float] = field(default_factory=list)
    generation: int = -1
    stall: int = 0
    best: float = FAILED

    @property
    def mean(self) -> float:
        """Mean fitness of the individuals that did not fail."""
        return float(np.mean([f for f in self.fitness if f < FAILED]))

    @property
    def diversity(self) -> float:
        """Standard deviation over the individuals (genes scaled to 0..1), mean over the genes."""
        return float(np.mean(np.std(np.array(self.unit), axis=0)))


def first_generation(seed: int, stage: str, size: int, start: Sequence[float]) -> Array:
    """Draw the first generation [size, F], genes scaled to 0..1: ``start`` [F], then uniform draws over the box."""
    rows = [list(start)]
    for slot in range(1, size):
        draw = random.Random(f"{seed}/{stage}/0/{slot}")  # noqa: S311  (a search, not a secret)
        rows.append([draw.random() for _ in start])
    return np.array(rows)


def offspring(population: Population, seed: int, stage: str, size: int) -> Array:
    """Make ``size`` children [size, F] (genes scaled to 0..1) of ``population``."""
    parents = [Individual(u, f) for u, f in zip(population.unit, population.fitness, strict=True)]
    generation = population.generation + 1
    with _LOCK:
        before = random.getstate()
        try:
            return np.array([_child(parents, f"{seed}/{stage}/{generation}/{slot}") for slot in range(size)])
        finally:
            random.setstate(before)


def _child(parents: list[Individual], key: str) -> list[float]:
    """Make one child [F] by differential crossover, blend crossover or mutation; ``key`` seeds the random generator.

    Stiffnesses compensate each other, so good individuals lie in narrow oblique valleys of the misfit. Crossovers that
    mix gene by gene (blend, simulated binary) leave the valley; a step along the difference of two other individuals
    (Storn and Price 1997) follows it, whatever its direction (figures: docs/decisions/0003).
    """
    random.seed(key)
    draw = random.random()  # noqa: S311
    if draw < DIFFERENTIAL:
        (origin,) = tools.selTournament(parents, 1, TOURNAMENT)
        ahead, behind = random.sample(parents, 2)
        scale = random.uniform(*DIFFERENCE_SCALE)  # noqa: S311
        child = [u + scale * (v - w) for u, v, w in zip(origin, ahead, behind, strict=True)]
    elif draw < DIFFERENTIAL + BLEND:
        child, other = (Individual(p) for p in tools.selTournament(parents, 2, TOURNAMENT))
        tools.cxBlend(child, other, BLEND_ALPHA)
    else:
        child = Individual(tools.selTournament(parents, 1, TOURNAMENT)[0])
        before = list(child)
        while list(child) == before:  # a child equal to its parent would be simulated for nothing
            tools.mutPolynomialBounded(child, MUTATION_ETA, 0.0, 1.0, 1.0 / len(child))
    return [reflected(u) for u in child]


def reflected(u: float) -> float:
    """Return ``u`` mirrored at the bounds into [0, 1]; clipping would put too many individuals on the bounds."""
    u = abs(u) % 2.0
    return 2.0 - u if u > 1.0 else u


def survive(population: Population, unit: Array, fitness: Array, distance: Array, tolerance: float) -> Population:
    """Return the best of ``population`` and its children ``unit`` [size, F], as many as there are children.

    ``fitness`` and ``distance`` [size] are those of the children. At equal fitness the parent is preferred, so that the
    order is reproducible. ``tolerance`` is the relative decrease of the best fitness that resets ``stall``.
    """
    size = len(unit)
    everyone = population.unit + [[float(v) for v in row] for row in unit]
    scores = population.fitness + [finite(f) for f in fitness]
    distances = population.distance + [finite(d) for d in distance]
    order = sorted(range(len(everyone)), key=lambda k: scores[k])[:size]
    best = scores[order[0]]
    improved = best < population.best * (1.0 - tolerance)
    return Population(
        unit=[everyone[k] for k in order],
        fitness=[scores[k] for k in order],
        distance=[distances[k] for k in order],
        generation=population.generation + 1,
        stall=0 if improved else population.stall + 1,
        best=best if improved else population.best,
    )


def finite(value: float) -> float:
    """Return ``value``, or the constant FAILED if ``value`` is not finite."""
    return float(value) if np.isfinite(value) else FAILED
