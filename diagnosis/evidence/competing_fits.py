"""Fits of suspects from the estimates: several run a race, and those that may still win go on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wingfit.calibration.estimates.linearised import unit_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.fit import FIT_ERRORS, SLOW_FACTOR, Fit, gauss_newton_fit, small_gain
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.screen import Trial, size_columns
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.weigh_hypotheses import tolerated_excess

Array = npt.NDArray[np.float64]

MAX_STEPS = 14  # of a fit
FIRST_STEPS = 5  # of each, its start among them, before those that leave least go on
SAME_FIT_DISTANCE = 0.05  # of a box: fits of the same suspects as near as this are one


@dataclass(frozen=True)
class StartPoint:
    """The nominal model with the suspects of ``trials``, whose genes begin at ``unit`` [E] in parts of their boxes."""

    trials: tuple[Trial, ...]
    unit: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Of the suspects."""
        return tuple(trial.suspect.name for trial in self.trials)


def start_points(trial: Trial, others: Sequence[Trial] = (), refit: Refit | None = None) -> list[StartPoint]:
    """A suspect of typical size where ``trial`` is, and at the typical place; ``beside`` it those of a ``refit``."""
    suspect = trial.suspect
    typical = unit_at(list(suspect.genes), np.array([suspect.typical[gene.name] for gene in suspect.genes]))
    size = size_columns(suspect)
    own = trial.unit[0].copy()
    own[size] = typical[size]
    starts = [own, typical] if suspect.location_genes and not np.allclose(own, typical) else [own]
    kept = dict(zip(refit.fit.problem.free, refit.fit.unit.tolist(), strict=True)) if refit else {}
    known = [kept[gene.name] for one in others for gene in one.suspect.genes]
    return [StartPoint((*others, trial), np.array([*known, *start])) for start in starts]


def fit_from_estimates(
    subject: Subject,
    data: WhitenedData,
    evaluator: Evaluator,
    initial: Fit,
    starts: Sequence[StartPoint],
    max_excess: float,
    target_excess: float = np.inf,
) -> Iterator[list[tuple[StartPoint, Fit]]]:
    """``every`` entry fitted from the estimates, where ``begun`` is.

    Where the nominal fit ended its genes have taken up what they could of a suspect, and may not find back. All run for
    RACE steps; then each that may still overtake the best goes on to its end. A fit ends early where it crawls and
    leaves far more than the best (`Policy.rivalry`), or more than ``most`` (m^2 or N^2 beyond the noise). One that does
    not lead also ends where it would leave as much, or more than is ``wanted``, even if it went on faster than it does
    (`Policy.speed`); and where another has come to the same.
    Yields all that do not leave as much after every step, the best first; nothing where none can be simulated.
    """
    fits = _CompetingFits(data, max_excess, target_excess)
    for entry in starts:
        fits.add(entry, _from_estimates(subject, data, evaluator, initial, entry))
        yield from fits.run(FIRST_STEPS)
    yield from fits.run(MAX_STEPS + 1)  # the last is where it ended, with its slopes


class _CompetingFits:
    """Fits that compete: each is given up where it crawls and leaves far more than the best, or than ``most``."""

    def __init__(self, data: WhitenedData, max_excess: float, target_excess: float) -> None:
        self.data, self.max_excess, self.target_excess = data, max_excess, target_excess
        self.fits = list[_CompetingFit]()

    def add(self, entry: StartPoint, steps: Iterator[Fit]) -> None:
        """One more."""
        self.fits.append(_CompetingFit(entry, steps))

    def run(self, steps: int) -> Iterator[list[tuple[StartPoint, Fit]]]:
        """All to as many ``steps``, those that leave least first; yields what is in front after each."""
        for fit in sorted(self.fits, key=lambda one: one.cost):
            while fit.steps_taken < steps and not self._should_stop(fit) and fit.step():
                yield self._rivals()

    def _should_stop(self, fit: _CompetingFit) -> bool:
        if len(fit.last_fits) < 2:
            return False
        before, now = fit.last_fits
        if small_gain(self.data, before, now, SLOW_FACTOR) and self._excess(fit) > min(
            self.max_excess, self._rivalry_limit()
        ):
            return True
        if fit.steps_taken < FIRST_STEPS or self._excess(fit) <= min(self._excess(one) for one in self.fits):
            return False
        return self._extrapolated_excess(fit) > min(self.target_excess, self._rivalry_limit()) or any(
            self._excess(other) <= self._excess(fit) and other.same_as(fit) for other in self.fits
        )

    def _extrapolated_excess(self, fit: _CompetingFit) -> float:
        """What a fit leaves in the end if it goes on faster than in its last step (`Policy.speed`)."""
        before, now = (self.data.excess(fit.coefficients) for fit in fit.last_fits)
        if now <= 0.0 or now >= before:
            return now
        return float(now * (now / before) ** (self.data.policy.speed * (MAX_STEPS + 1 - fit.steps_taken)))

    def _excess(self, fit: _CompetingFit) -> float:
        return self.data.excess(fit.last_fits[-1].coefficients) if fit.last_fits else np.inf

    def _rivalry_limit(self) -> float:
        """What leaves more is no rival of the best; above what noise may make of nothing."""
        return max(
            self.data.policy.rivalry * min(self._excess(one) for one in self.fits),
            tolerated_excess(self.data, 0.0, 0.0),
        )

    def _rivals(self) -> list[tuple[StartPoint, Fit]]:
        initial = sorted((one for one in self.fits if one.last_fits), key=lambda one: one.cost)
        return [
            (one.entry, one.last_fits[-1])
            for one in initial
            if one is initial[0] or self._excess(one) <= self._rivalry_limit()
        ]


@dataclass
class _CompetingFit:
    """A fit on its way, with its last two steps."""

    entry: StartPoint
    steps: Iterator[Fit]
    last_fits: list[Fit] = field(default_factory=list)
    steps_taken: int = 0

    @property
    def cost(self) -> float:
        """Of the last step; infinite before the first."""
        return self.last_fits[-1].cost if self.last_fits else np.inf

    def same_as(self, other: _CompetingFit) -> bool:
        """Whether two fits of the same suspects, each begun, have come to the same."""
        if self is other or self.entry.names != other.entry.names:
            return False
        return bool(np.abs(self.last_fits[-1].unit - other.last_fits[-1].unit).max() <= SAME_FIT_DISTANCE)

    def step(self) -> bool:
        """Whether there was another step."""
        try:
            self.last_fits = [*self.last_fits[-1:], next(self.steps)]
        except (StopIteration, *FIT_ERRORS):
            return False
        self.steps_taken += 1
        return True


def _from_estimates(
    subject: Subject, data: WhitenedData, evaluator: Evaluator, initial: Fit, entry: StartPoint
) -> Iterator[Fit]:
    """Fits of the nominal model with the suspects of ``entry``; CannotBeginError where they cannot begin."""
    suspects = [trial.suspect for trial in entry.trials]
    model = subject.extended([suspect.name for suspect in suspects])
    free = (*initial.problem.free, *(gene.name for suspect in suspects for gene in suspect.genes))
    problem = Problem(model, data.recordings, free, base_genome(model, initial.problem.base.as_dict()), data.axes)
    return gauss_newton_fit(subject, data, problem, evaluator, np.concatenate([initial.unit, entry.unit]), MAX_STEPS)
