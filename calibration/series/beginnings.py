"""Estimates the genes that belong to a single recording, such as its initial state, from its first samples.

Later samples depend on the initial state and on all other genes at once: where an oscillation is half a period off, the
cost of a wrong initial state has local minima, in which a fit ends. The first samples hardly depend on the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, unit_at, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Misfit, Problem, spans
from wingfit.inference.gauss_newton import Quadratic
from wingfit.records import Gene, Series
from wingfit.records.array_types import Array, Float, Index
from wingfit.records.blas_threads import one_blas_thread
from wingfit.records.series import belongs_to, recording_gene

SAMPLES_PER_GENE = 3  # sample times in the first window; each further window is twice as long
MODEL_ERROR = 0.02  # of the range of a channel: error with which a model not yet fitted simulates the beginning
PRIOR_SD = 0.5  # of a gene, scaled to 0..1
SINGULAR = 1e-9  # of the largest curvature, added so that none is singular
DIFFERENCE = 1e-3  # of a gene, scaled to 0..1
STEEPEST = 1e100  # of a whitened residual by a gene: squares beyond it are not finite
PARTS = np.array([1.0, 0.25])  # of a step that are tried
STEPS = 3  # in each window


class Beginnings(NamedTuple):
    """Values by name of the genes that belong to a single series, and how many individuals were simulated."""

    values: dict[str, float]
    evaluations: int


@one_blas_thread
def from_beginnings(problem: Problem, evaluator: Evaluator, values: Mapping[str, float]) -> Beginnings:
    """Estimate the free genes that belong to a single series from its beginning; all others are at ``values``.

    Genes that are not in ``values`` (by name) are at the base. A gene in ``values``, and one for which the recording
    states an estimate, is known and stays out.

    The genes are fitted to a window of the first samples, with Gauss-Newton steps, then to windows that are twice as
    long, while the model follows all samples of the window and predicts those after it, as many: within MODEL_ERROR and
    the noise that the recording states, or better than before. They keep their values where even the first window
    predicts nothing better, as with first samples that are wrong, or where the simulation fails.
    """
    known = [_Beginning.of(problem, one, values) for one in problem.recordings if isinstance(one, Series)]
    parts = [part for part in known if part.columns]
    if not parts:
        return Beginnings({}, 0)
    simulate = _Simulator(replace(problem, recordings=tuple(part.recording for part in parts)), evaluator)
    unit = unit_at(simulate.genes, np.array([values.get(name, problem.base[name]) for name in problem.free]))
    accepted, growing = unit.copy(), dict(enumerate(parts))
    now = simulate(accepted[None])
    while growing:
        found, then = _fitted(simulate, growing, accepted, now)
        better = {k for k, part in growing.items() if part.is_better(then[k], now[k])}
        for k in better:
            accepted[parts[k].columns] = found[parts[k].columns]
        now = [then[k] if k in better else one for k, one in enumerate(now)]
        growing = {k: longer for k in sorted(better) if (longer := growing[k].longer()) is not None}
    end = values_at(simulate.genes, accepted[None])[0]
    own = {problem.free[column]: float(end[column]) for part in parts for column in part.columns}
    return Beginnings(own, simulate.evaluations)


@dataclass
class _Simulator:
    """Simulates the free genes of ``problem``, given scaled to 0..1, and counts the individuals."""

    problem: Problem
    evaluator: Evaluator
    evaluations: int = 0
    genes: list[Gene] = field(init=False)

    def __post_init__(self) -> None:
        self.genes = free_genes(self.problem)

    def __call__(self, units: Float[Array, "B F"]) -> list[Misfit]:
        self.evaluations += len(units)
        batch = values_at(self.genes, units)
        return list(self.evaluator.evaluate(self.problem, batch, residuals=True).per_recording)


@dataclass(frozen=True)
class _Beginning:
    """The first samples of a recording.

    Attributes:
        recording: the whole.
        columns: places of its K own genes among the free ones.
        start: [K] their first values, scaled to 0..1; the prior says that they are near these.
        rows: [N] places of the sample times at which something was recorded.
        count: how many of these are in the window.
        scale: [C] error to expect in each channel.
        is_first: whether the window is the shortest.
    """

    recording: Series
    columns: list[int]
    start: Float[Array, " K"]
    rows: Index
    count: int
    scale: Float[Array, " C"]
    is_first: bool = True

    @classmethod
    def of(cls, problem: Problem, recording: Series, known: Mapping[str, float]) -> _Beginning:
        stated = {*known, *(recording_gene(name, recording.name) for name in recording.estimates)}
        own = [k for k, name in enumerate(problem.free) if belongs_to(name, recording.name) and name not in stated]
        genes = free_genes(problem)
        start = unit_at([genes[k] for k in own], np.array([problem.base[genes[k].name] for k in own]))
        (rows,) = np.nonzero(recording.valid.any(axis=1))
        noise = np.array([channel.standard_deviation or 0.0 for channel in recording.quantities])
        scale = np.hypot(MODEL_ERROR * spans(recording), noise)
        return cls(recording, own, start, rows, SAMPLES_PER_GENE * len(own), scale)

    def longer(self) -> _Beginning | None:
        """Return this with a window of twice the samples; None where no samples would follow it."""
        return replace(self, count=2 * self.count, is_first=False) if 2 * self.count < len(self.rows) else None

    def whitened(self, misfit: Misfit, individual: int, *, following: bool = False) -> Array | None:
        """Return the residuals [N] of the window, or of the ``following`` samples, as many; None if failed."""
        if misfit.reasons[individual] is not None or misfit.residuals is None:
            return None
        rows = self.rows[self.count : 2 * self.count] if following else self.rows[: self.count]
        found = (misfit.residuals[individual] / self.scale)[rows]
        return np.asarray(found[self.recording.valid[rows]])

    def cost(self, misfit: Misfit, individual: int, own: Float[Array, " K"]) -> float:
        """Return the cost of an individual with the genes ``own`` [K] in the window; infinite where it failed."""
        white, off = self.whitened(misfit, individual), (own - self.start) / PRIOR_SD
        return np.inf if white is None else float(white @ white + off @ off)

    def is_better(self, found: Misfit, before: Misfit) -> bool:
        """Return whether the genes that gave ``found`` replace those that gave ``before``, each of one individual."""
        inside, following = self.whitened(found, 0), self.whitened(found, 0, following=True)
        if inside is None or following is None or not len(following):
            return False
        follows = self.is_first or float(inside @ inside) <= len(inside)
        earlier, squares = self.whitened(before, 0, following=True), float(following @ following)
        predicts = earlier is None or squares < float(earlier @ earlier)
        return follows and (predicts or (not self.is_first and squares <= len(following)))


def _fitted(
    simulate: _Simulator, parts: Mapping[int, _Beginning], unit: Float[Array, " F"], now: Sequence[Misfit]
) -> tuple[Float[Array, " F"], list[Misfit]]:
    """Return ``unit`` [F] with the own genes of ``parts`` fitted to their windows, and the misfits there.

    ``now``: misfits at ``unit``; ``parts``: by number of the recording. The own genes number k of all recordings are
    displaced in the same simulation, as no other recording depends on them. No cost increases.
    """
    for _ in range(STEPS):
        displaced = np.tile(unit, (max(len(part.columns) for part in parts.values()), 1))
        for part in parts.values():
            for k, column in enumerate(part.columns):
                displaced[k, column] += DIFFERENCE if unit[column] < 0.5 else -DIFFERENCE
        beside, moves = simulate(displaced), np.zeros(len(unit))
        for r, part in parts.items():
            moves[part.columns] = _move(part, now[r], beside[r], unit, displaced)
        if not moves.any():
            break
        tried = np.clip(unit + PARTS[:, None] * moves, 0.0, 1.0)
        then, stepped = simulate(tried), unit.copy()
        places = list(now)
        for r, part in parts.items():
            costs = [part.cost(then[r], k, one[part.columns]) for k, one in enumerate(tried)]
            k = int(np.argmin(costs))
            if costs[k] < part.cost(now[r], 0, unit[part.columns]):
                stepped[part.columns], places[r] = tried[k, part.columns], then[r].taken([k])
        unit, now = stepped, places
    return unit, list(now)


def _move(
    part: _Beginning, now: Misfit, beside: Misfit, unit: Float[Array, " F"], displaced: Float[Array, "K F"]
) -> Float[Array, " K"]:
    """Return the step [K] of the own genes of a recording; zero where an individual failed, or is absurd."""
    own, none = unit[part.columns], np.zeros(len(part.columns))
    white = part.whitened(now, 0)
    others = [part.whitened(beside, k) for k in range(len(own))]
    seen = [one for one in others if one is not None]
    if white is None or len(seen) < len(own):
        return none
    amounts = [displaced[k, column] - unit[column] for k, column in enumerate(part.columns)]
    slopes = np.stack([(other - white) / by for other, by in zip(seen, amounts, strict=True)], axis=1)
    if float(np.abs(slopes).max()) > STEEPEST:
        return none
    curvature = slopes.T @ slopes + np.eye(len(own)) / PRIOR_SD**2
    slope = slopes.T @ white + (own - part.start) / PRIOR_SD**2
    damping = np.full(len(own), SINGULAR * float(curvature.max()))
    return Quadratic(curvature, slope).step(own, damping)
