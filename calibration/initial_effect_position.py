"""Chooses where an effect that is switched off acts when Gauss-Newton starts.

While the size of an effect is zero, the misfit does not depend on the effect's other genes, which say where and how it
acts (below: its place). So Gauss-Newton cannot move them, and at a wrong place it may keep the size at zero. Therefore
several places are tried before the first iteration, and the one is taken at which a small size would lower the misfit
most if all other genes were refitted. The size stays zero, so the simulation of the start does not change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.calibration.effects import AddedEffect, added_effects
from wingfit.calibration.estimates.linearised import Linearised, free_genes, linearise, residuals_of, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.inference.noise.white import Noise, whitened_sensitivity
from wingfit.inference.score_test import INVISIBLE, Nuisance, amounts, remaining, spread
from wingfit.records.array_types import Array

PLACES = 15  # places tried, besides the initial one: with a single size a batch of two groups of lanes
SMALL = 0.02  # step of a size, as a fraction of the range between its bounds


def placed(problem: Problem, evaluator: Evaluator, unit: Array) -> tuple[Array, int]:
    """Move every effect of size zero to its best place; return the start [F] and the number of simulated individuals.

    ``unit`` [F] is the start before, genes scaled to 0..1. Returned unchanged if there is no such effect.
    """
    effects = _movable(problem, unit)
    if not effects:
        return unit, 0
    linear = linearise(problem, evaluator, unit)
    moved = {name for effect in effects for name in effect.genes}
    weighed = _Weighed.of(problem, linear, [name not in moved for name in problem.free])
    start, evaluated = unit.copy(), linear.evaluations
    for effect in effects:
        own = [k for k, name in enumerate(problem.free) if name in effect.genes]
        size = [k for k in own if problem.free[k] in effect.sizes]
        tried = _tried(unit, [k for k in own if k not in size])
        batch = _small(size, unit, tried)
        evaluation = evaluator.evaluate(problem, values_at(free_genes(problem), batch), residuals=True)
        evaluated += len(batch)
        gains = weighed.gains(evaluation, _limits(size, unit))
        start[own] = tried[int(np.argmax(gains))][own]
    return start, evaluated


@dataclass(frozen=True)
class _Weighed:
    """Whitened residuals ``white`` [N] at the start, and the changes of them that the genes ``others`` can cancel.

    N counts the values of all recordings. ``noise`` whitens, one per recording; ``others`` are the genes that do not
    belong to the effects to be moved.
    """

    noise: list[Noise]
    white: Array
    others: Nuisance

    @classmethod
    def of(cls, problem: Problem, linear: Linearised, which: list[bool]) -> _Weighed:
        noise = Noise.of_each(problem.recordings, linear.residuals)
        white = np.concatenate([n.whitened(v).ravel() for n, v in zip(noise, linear.residuals, strict=True)])
        slopes = [
            whitened_sensitivity(n, s[:, :, which]).reshape(-1, sum(which))
            for n, s in zip(noise, linear.sensitivities, strict=True)
        ]
        return cls(noise, white, Nuisance.of(np.concatenate(slopes)))

    def gains(self, evaluation: Evaluation, limits: tuple[Array, Array]) -> list[float]:
        """Return, for each place, by how much sizes within ``limits`` (S each) lower the whitened sum of squares.

        ``evaluation`` has S individuals for each place, in each of which one of the S sizes is small and not zero. A
        place at which one of them failed gets 0.
        """
        parts = zip(self.noise, residuals_of(evaluation), strict=True)
        after = np.concatenate([n.whitened(v).reshape(len(v), -1) for n, v in parts], axis=1)
        blocks = (after - self.white).reshape(-1, len(limits[0]), len(self.white))
        failed = np.array([reason is not None for reason in evaluation.reasons]).reshape(-1, len(limits[0]))
        return [0.0 if bad.any() else self._gain(block, limits) for bad, block in zip(failed, blocks, strict=True)]

    def _gain(self, changes: Array, limits: tuple[Array, Array]) -> float:
        left, own = self.others.rest(self.white), self.others.rest(changes)
        multiples = amounts(own, left, limits, INVISIBLE * float(np.linalg.norm(changes)))
        return float(left @ left) - remaining(own, left, multiples)


def _movable(problem: Problem, unit: Array) -> list[AddedEffect]:
    """Return the effects of size zero at ``unit`` [F] of which a size and at least one other gene are searched."""
    genes = free_genes(problem)
    genome = problem.base.as_dict() | dict(zip(problem.free, values_at(genes, unit[None])[0].tolist(), strict=True))
    movable = []
    for effect in added_effects(problem.model, problem.free):
        kinds = {name in effect.sizes for name in problem.free if name in effect.genes}
        if kinds == {True, False} and all(genome[name] == 0.0 for name in effect.sizes):
            movable.append(effect)
    return movable


def _tried(unit: Array, shape: list[int]) -> Array:
    """Return starts [1 + PLACES, F]: ``unit`` [F], then copies with the genes ``shape`` spread evenly over 0..1."""
    tried = np.tile(unit, (1 + PLACES, 1))
    tried[1:, shape] = spread(PLACES, len(shape))
    return tried


def _limits(size: list[int], unit: Array) -> tuple[Array, Array]:
    """Return the least and largest allowed multiple [S] of the step of :func:`_small` for each of the S size genes.

    ``size`` are their columns in ``unit`` [F]. Only a single size that starts at a bound is limited: to at least zero.
    """
    one_sided = len(size) == 1 and not SMALL <= unit[size[0]] <= 1.0 - SMALL
    return np.full(len(size), 0.0 if one_sided else -np.inf), np.full(len(size), np.inf)


def _small(size: list[int], unit: Array, tried: Array) -> Array:
    """Return S copies of every row of ``tried`` [P, F], in each of which one of S size genes is moved by SMALL.

    [P x S, F] in genes scaled to 0..1; ``size`` are the columns of the size genes, whose start is in ``unit`` [F].
    """
    moves = np.array([SMALL if unit[k] + SMALL <= 1.0 else -SMALL for k in size])
    batch = np.repeat(tried, len(size), axis=0)
    batch[np.arange(len(batch)), np.tile(size, len(tried))] += np.tile(moves, len(tried))
    return batch
