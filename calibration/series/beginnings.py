"""Estimates the genes that belong to a single recording, such as its initial state, from its first samples.

Later samples depend on the initial state and on all other genes at once: where an oscillation is half a period off, the
cost of a wrong initial state has local minima, in which a fit ends. The first samples hardly depend on the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, unit_at, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Misfit, Problem, spans
from wingfit.inference.gauss_newton import Quadratic
from wingfit.records import Gene, Series
from wingfit.records.array_types import Array, Float, Mask
from wingfit.records.series import belongs_to, recording_gene

SHARE = 0.01  # of the samples of a recording count as its beginning,
VALUES_PER_GENE = 3  # and as many more as give so many values for each gene
MODEL_ERROR = 0.02  # of the range of a channel: error with which a model not yet fitted simulates the beginning
PRIOR_SD = 0.5  # of a gene, scaled to 0..1
DIFFERENCE = 1e-3  # of a gene, scaled to 0..1
PARTS = np.array([1.0, 0.25])  # of a step that are tried
STEPS = 4


def from_beginnings(problem: Problem, evaluator: Evaluator, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values by name of the free genes that belong to a single series, estimated from its beginning.

    All other genes are at ``values``, or at the base. A gene in ``values``, and one for which the recording states an
    estimate, is known and stays out, and so do the genes of a recording whose simulation fails.
    """
    genes = free_genes(problem)
    unit = unit_at(genes, np.array([values.get(name, problem.base[name]) for name in problem.free]))
    parts = [
        _Beginning.of(k, problem, one, values) for k, one in enumerate(problem.recordings) if isinstance(one, Series)
    ]
    parts = [part for part in parts if part.columns]
    simulator = _Simulator(problem, evaluator, genes)
    for _ in range(STEPS if parts else 0):
        unit = _stepped(simulator, parts, unit)
    found = values_at(genes, unit[None])[0]
    return {problem.free[k]: float(found[k]) for part in parts for k in part.columns}


@dataclass(frozen=True)
class _Simulator:
    """Simulates ``genes``, the free ones of ``problem``, given scaled to 0..1."""

    problem: Problem
    evaluator: Evaluator
    genes: list[Gene]

    def __call__(self, units: Float[Array, "B F"]) -> tuple[Misfit, ...]:
        values = values_at(self.genes, units)
        return self.evaluator.evaluate(self.problem, values, residuals=True).per_recording


@dataclass(frozen=True)
class _Beginning:
    """The first samples of a recording.

    Attributes:
        place: of the recording among those of the problem.
        columns: places of its K own genes among the free ones.
        start: [K] their values at first, scaled to 0..1; the prior says that they are near these.
        compared: [T, C] whether a sample of a channel counts.
        scale: [C] error to expect.
    """

    place: int
    columns: list[int]
    start: Float[Array, " K"]
    compared: Mask
    scale: Float[Array, " C"]

    @classmethod
    def of(cls, place: int, problem: Problem, recording: Series, known: Mapping[str, float]) -> _Beginning:
        stated = {*known, *(recording_gene(name, recording.name) for name in recording.estimates)}
        own = [k for k, name in enumerate(problem.free) if belongs_to(name, recording.name) and name not in stated]
        genes = free_genes(problem)
        start = unit_at([genes[k] for k in own], np.array([problem.base[genes[k].name] for k in own]))
        count = recording.valid.sum(axis=1)
        before = np.cumsum(count) - count  # values before each sample time
        enough = max(VALUES_PER_GENE * len(own), SHARE * count.sum())
        return cls(place, own, start, recording.valid & (before < enough)[:, None], MODEL_ERROR * spans(recording))

    def whitened(self, misfits: Sequence[Misfit], individual: int) -> Array | None:
        """Return the compared residuals [N] of one ``individual``, relative to the error; None where it failed."""
        misfit = misfits[self.place]
        if misfit.reasons[individual] is not None or misfit.residuals is None:
            return None
        return np.asarray((misfit.residuals[individual] / self.scale)[self.compared])

    def cost(self, misfits: Sequence[Misfit], individual: int, unit: Float[Array, " F"]) -> float:
        """Return the cost of one ``individual``, whose genes are ``unit`` [F]; infinite where it failed."""
        white = self.whitened(misfits, individual)
        off = (unit[self.columns] - self.start) / PRIOR_SD
        return np.inf if white is None else float(white @ white + off @ off)


def _stepped(simulate: _Simulator, parts: Sequence[_Beginning], unit: Float[Array, " F"]) -> Float[Array, " F"]:
    """Return ``unit`` [F] after a Gauss-Newton step of the own genes of every recording; no cost increases.

    The own genes number k of all recordings are displaced in the same simulation, as no other recording sees them.
    """
    displaced = np.tile(unit, (1 + max(len(part.columns) for part in parts), 1))
    for part in parts:
        for k, column in enumerate(part.columns, 1):
            displaced[k, column] += DIFFERENCE if unit[column] < 0.5 else -DIFFERENCE
    now, moves = simulate(displaced), np.zeros(len(unit))
    for part in parts:
        moves[part.columns] = _move(part, now, displaced)
    tried = np.clip([unit + share * moves for share in PARTS], 0.0, 1.0)
    then, stepped = simulate(tried), unit.copy()
    for part in parts:
        costs = [part.cost(now, 0, unit), *(part.cost(then, k, one) for k, one in enumerate(tried))]
        stepped[part.columns] = [unit, *tried][int(np.argmin(costs))][part.columns]
    return stepped


def _move(part: _Beginning, misfits: Sequence[Misfit], displaced: Float[Array, "B F"]) -> Float[Array, " K"]:
    """Return the step [K] of the own genes of a recording; zero where one of the ``displaced`` individuals failed."""
    unit = displaced[0, part.columns]
    found = [part.whitened(misfits, k) for k in range(1 + len(part.columns))]
    white, others = found[0], [one for one in found[1:] if one is not None]
    if white is None or len(others) < len(part.columns):
        return np.zeros(len(unit))
    amounts = [displaced[k, column] - displaced[0, column] for k, column in enumerate(part.columns, 1)]
    slopes = np.stack([(other - white) / by for other, by in zip(others, amounts, strict=True)], axis=1)
    curvature = slopes.T @ slopes + np.eye(len(unit)) / PRIOR_SD**2
    slope = slopes.T @ white + (unit - part.start) / PRIOR_SD**2
    return Quadratic(curvature, slope).step(unit, np.zeros(len(unit)))
