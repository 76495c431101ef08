"""Fit several suspects in competition, from the estimates of the genes; fits that can no longer win are stopped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, unit_at, values_at
from wingfit.calibration.problem import base_genome
from wingfit.calibration.series.beginnings import from_beginnings
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import FIT_ERRORS, SLOW_FACTOR, Fit, gauss_newton_fit, small_gain
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.screen import (
    Trial,
    off_units,
    positions_of,
    size_columns,
    typical_units,
    units_at_position,
)
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.weigh_hypotheses import tolerated_excess
from wingfit.records.array_types import Array, Float

LARGE = 3.0  # times the typical size; 0.6 of the bound of a law at a port
MAX_STEPS = 14  # of a fit
FIRST_STEPS = 5  # of each fit, its start included, before only the best continue
SAME_FIT_DISTANCE = 0.05  # of a box: fits of the same suspects that are this near are the same


@dataclass(frozen=True)
class StartPoint:
    """A start: the nominal model plus the suspects of ``trials``, their E genes at ``unit`` [E], bounds at 0 and 1."""

    trials: tuple[Trial, ...]
    unit: Float[Array, " E"]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the suspects."""
        return tuple(trial.suspect.name for trial in self.trials)


def start_points(trial: Trial, others: Sequence[Trial] = (), refit: Refit | None = None) -> list[StartPoint]:
    """Return starts with the suspect of ``trial`` at typical size: at the trial's location, and at a typical one.

    Where its size is a choice, there is also a start at each position. The suspects of ``others`` are in the model
    too, with the genes that were fitted in ``refit``.
    """
    suspect = trial.suspect
    typical, size = typical_units(suspect), size_columns(suspect)
    own = trial.unit[0].copy()
    own[size] = typical[size]
    starts = [own, typical] if suspect.location_genes and not np.allclose(own, typical) else [own]
    if suspect.positions:
        starts = [own, *(units_at_position(trial, *one) for one in positions_of(suspect))]
    fitted = dict(zip(refit.fit.problem.free, refit.fit.unit.tolist(), strict=True)) if refit else {}
    known = [fitted[gene.name] for one in others for gene in one.suspect.genes]
    return [StartPoint((*others, trial), np.array([*known, *start])) for start in starts]


def large_start(trial: Trial, *, typical_shape: bool = False) -> StartPoint:
    """Return a start at LARGE times the typical size of the suspect of ``trial``, with the sign of its score test.

    A large effect changes the frequency of an oscillation so much that a fit with a small one does not come to it. It
    changes the motion of a wing so much that its location in a score test, which is of a small one, may be that of
    another cause: with ``typical_shape`` it starts at the typical location and shape.
    """
    off, typical, size = off_units(trial.suspect), typical_units(trial.suspect), size_columns(trial.suspect)
    unit = (typical if typical_shape else trial.unit[0]).copy()
    sign = np.where(trial.start[size] < off[size], -1.0, 1.0)
    unit[size] = np.clip(off[size] + LARGE * sign * np.abs(typical[size] - off[size]), 0.0, 1.0)
    return StartPoint((trial,), unit)


def fit_from_estimates(
    context: FitContext, initial: Fit, starts: Sequence[StartPoint], limit: float, target: float = np.inf
) -> Iterator[list[tuple[StartPoint, Fit]]]:
    """Fit all ``starts`` from the nominal genes of ``initial`` (the estimates); yields the best after every step.

    At the nominal fit, genes have absorbed what they could of a suspect's effect, and a fit may not undo that. Each
    report has the best start with its fit, and all whose excess is not much larger (`Policy.rivalry`); there is none
    where no start can be simulated. Every fit runs for FIRST_STEPS; then each that can still overtake the best
    continues. A fit is stopped

    - where a step gains little and its excess is far above the best (`Policy.rivalry`) or above ``limit`` (m^2 or N^2);
    - where it is not the best, and even with faster progress (`Policy.acceleration`) would end far above the best, or
      above ``target`` (m^2 or N^2);
    - where a better fit of the same suspects has come to the same genes.
    """
    fits = _CompetingFits(context.data, limit, target)
    for start in starts:
        fits.add(start, _from_estimates(context, initial, start))
        yield from fits.run(FIRST_STEPS)
    yield from fits.run(MAX_STEPS + 1)  # the last is where it ended, with its slopes


class _CompetingFits:
    """Fits that run side by side, hopeless ones being stopped; ``limit``, ``target``: see fit_from_estimates."""

    def __init__(self, data: WhitenedData, limit: float, target: float) -> None:
        self.data, self.limit, self.target = data, limit, target
        self.fits = list[_CompetingFit]()

    def add(self, start: StartPoint, steps: Iterator[Fit]) -> None:
        """Add the fit from ``start``; the iterator ``steps`` yields its successive results."""
        self.fits.append(_CompetingFit(start, steps))

    def run(self, steps: int) -> Iterator[list[tuple[StartPoint, Fit]]]:
        """Continue all fits, lowest cost first, up to ``steps`` steps each; yields the best fits after each step."""
        for fit in sorted(self.fits, key=lambda one: one.cost):
            while fit.steps_taken < steps and not self._should_stop(fit) and fit.step():
                yield self._rivals()

    def _should_stop(self, fit: _CompetingFit) -> bool:
        if len(fit.last_fits) < 2:
            return False
        (before, now), excess, rivalry = fit.last_fits, self._excess(fit), self._rivalry_limit()
        if small_gain(self.data, before, now, SLOW_FACTOR) and excess > min(self.limit, rivalry):
            return True
        if fit.steps_taken < FIRST_STEPS or excess <= min(self._excess(one) for one in self.fits):
            return False
        repeated = any(self._excess(other) <= excess and other.same_as(fit) for other in self.fits)
        return self._expected_excess(fit) > min(self.target, rivalry) or repeated

    def _expected_excess(self, fit: _CompetingFit) -> float:
        """Return the excess over the noise at the last step if progress becomes `Policy.acceleration` times as fast."""
        before, now = (self.data.excess(one.coefficients) for one in fit.last_fits)
        if now <= 0.0 or now >= before:
            return now
        return float(now * (now / before) ** (self.data.policy.acceleration * (MAX_STEPS + 1 - fit.steps_taken)))

    def _excess(self, fit: _CompetingFit) -> float:
        return self.data.excess(fit.last_fits[-1].coefficients) if fit.last_fits else np.inf

    def _rivalry_limit(self) -> float:
        """Return the excess above which a fit is no rival of the best: a multiple of its, at least that of noise."""
        least = min(self._excess(one) for one in self.fits)
        return max(self.data.policy.rivalry * least, tolerated_excess(self.data, 0.0, 0.0))

    def _rivals(self) -> list[tuple[StartPoint, Fit]]:
        first, *others = sorted((one for one in self.fits if one.last_fits), key=lambda one: one.cost)
        rivals = [first, *(one for one in others if self._excess(one) <= self._rivalry_limit())]
        return [(one.start, one.last_fits[-1]) for one in rivals]


@dataclass
class _CompetingFit:
    """A running fit: its start, the iterator over its steps, the last two results, and the number of steps."""

    start: StartPoint
    steps: Iterator[Fit]
    last_fits: list[Fit] = field(default_factory=list)
    steps_taken: int = 0

    @property
    def cost(self) -> float:
        """Cost at the last step; infinite before the first."""
        return self.last_fits[-1].cost if self.last_fits else np.inf

    def same_as(self, other: _CompetingFit) -> bool:
        """Return whether ``other`` is a different fit of the same suspects that has come to the same genes."""
        if self is other or self.start.names != other.start.names:
            return False
        return bool(np.abs(self.last_fits[-1].unit - other.last_fits[-1].unit).max() <= SAME_FIT_DISTANCE)

    def step(self) -> bool:
        """Take a step; return False where the fit has ended or failed."""
        try:
            self.last_fits = [*self.last_fits[-1:], next(self.steps)]
        except (StopIteration, *FIT_ERRORS):
            return False
        self.steps_taken += 1
        return True


def _from_estimates(context: FitContext, initial: Fit, start: StartPoint) -> Iterator[Fit]:
    """Yield the steps of a fit from ``initial`` and ``start``; InitialSimulationError if these cannot be simulated.

    Genes that belong to a single series start with what its beginning shows, the suspects of ``start`` being there.
    """
    suspects = [trial.suspect for trial in start.trials]
    model = context.subject.extended([suspect.name for suspect in suspects])
    added = [gene for suspect in suspects for gene in suspect.genes]
    values = dict(zip((gene.name for gene in added), values_at(added, start.unit[None])[0].tolist(), strict=True))
    free = (*initial.problem.free, *values)
    problem = context.problem(model, free, base_genome(model, initial.problem.base.as_dict()))
    own = from_beginnings(problem, context.evaluator, values).values
    shown = unit_at(free_genes(problem), np.array([own.get(name, problem.base[name]) for name in free]))
    unit = np.where([name in own for name in free], shown, np.concatenate([initial.unit, start.unit]))
    yield from gauss_newton_fit(context, problem, unit, MAX_STEPS)
