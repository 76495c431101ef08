"""Fits of suspects from the estimates: several run a race, and those that may still win go on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wingfit.calibration.estimates.linearised import unit_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.fit import CRAWLING, UNFIT, Fit, gained_little, thoroughly
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.screen import Trial, size_columns
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.weigh_hypotheses import tolerated

Array = npt.NDArray[np.float64]

STEPS = 14  # of a fit
RACE = 5  # of each, its start among them, before those that leave least go on
SAME = 0.05  # of a box: fits of the same suspects as near as this are one


@dataclass(frozen=True)
class Entry:
    """The nominal model with the suspects of ``trials``, whose genes begin at ``unit`` [E] in parts of their boxes."""

    trials: tuple[Trial, ...]
    unit: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Of the suspects."""
        return tuple(trial.suspect.name for trial in self.trials)


def entries(trial: Trial, beside: Sequence[Trial] = (), refit: Refit | None = None) -> list[Entry]:
    """A suspect of typical size where ``trial`` is, and at the typical place; ``beside`` it those of a ``refit``."""
    suspect = trial.suspect
    typical = unit_at(list(suspect.genes), np.array([suspect.typical[gene.name] for gene in suspect.genes]))
    size = size_columns(suspect)
    own = trial.unit[0].copy()
    own[size] = typical[size]
    starts = [own, typical] if suspect.places and not np.allclose(own, typical) else [own]
    kept = dict(zip(refit.fit.problem.free, refit.fit.unit.tolist(), strict=True)) if refit else {}
    known = [kept[gene.name] for one in beside for gene in one.suspect.genes]
    return [Entry((*beside, trial), np.array([*known, *start])) for start in starts]


def afresh(
    subject: Subject,
    stack: Stack,
    evaluator: Evaluator,
    begun: Fit,
    every: Sequence[Entry],
    most: float,
    wanted: float = np.inf,
) -> Iterator[list[tuple[Entry, Fit]]]:
    """``every`` entry fitted from the estimates, where ``begun`` is.

    Where the nominal fit ended its genes have taken up what they could of a suspect, and may not find back. All run for
    RACE steps; then each that may still overtake the best goes on to its end. A fit ends early where it crawls and
    leaves far more than the best (`Policy.rivalry`), or more than ``most`` (m^2 or N^2 beyond the noise). One that does
    not lead also ends where it would leave as much, or more than is ``wanted``, even if it went on faster than it does
    (`Policy.speed`); and where another has come to the same.
    Yields all that do not leave as much after every step, the best first; nothing where none can be simulated.
    """
    race = _Race(stack, most, wanted)
    for entry in every:
        race.enter(entry, _from_estimates(subject, stack, evaluator, begun, entry))
        yield from race.run(RACE)
    yield from race.run(STEPS + 1)  # the last is where it ended, with its slopes


class _Race:
    """Fits that compete: each is given up where it crawls and leaves far more than the best, or than ``most``."""

    def __init__(self, stack: Stack, most: float, wanted: float) -> None:
        self.stack, self.most, self.wanted = stack, most, wanted
        self.runners = list[_Runner]()

    def enter(self, entry: Entry, steps: Iterator[Fit]) -> None:
        """One more."""
        self.runners.append(_Runner(entry, steps))

    def run(self, steps: int) -> Iterator[list[tuple[Entry, Fit]]]:
        """All to as many ``steps``, those that leave least first; yields what is in front after each."""
        for runner in sorted(self.runners, key=lambda one: one.cost):
            while runner.taken < steps and not self._given_up(runner) and runner.step():
                yield self._in_front()

    def _given_up(self, runner: _Runner) -> bool:
        if len(runner.fits) < 2:
            return False
        before, now = runner.fits
        if gained_little(self.stack, before, now, CRAWLING) and self._left(runner) > min(self.most, self._behind()):
            return True
        if runner.taken < RACE or self._left(runner) <= min(self._left(one) for one in self.runners):
            return False
        return self._foreseen(runner) > min(self.wanted, self._behind()) or any(
            self._left(other) <= self._left(runner) and other.at_the_same(runner) for other in self.runners
        )

    def _foreseen(self, runner: _Runner) -> float:
        """What a fit leaves in the end if it goes on faster than in its last step (`Policy.speed`)."""
        before, now = (self.stack.excess(fit.coefficients) for fit in runner.fits)
        if now <= 0.0 or now >= before:
            return now
        return float(now * (now / before) ** (self.stack.policy.speed * (STEPS + 1 - runner.taken)))

    def _left(self, runner: _Runner) -> float:
        return self.stack.excess(runner.fits[-1].coefficients) if runner.fits else np.inf

    def _behind(self) -> float:
        """What leaves more is no rival of the best; above what noise may make of nothing."""
        return max(
            self.stack.policy.rivalry * min(self._left(one) for one in self.runners), tolerated(self.stack, 0.0, 0.0)
        )

    def _in_front(self) -> list[tuple[Entry, Fit]]:
        begun = sorted((one for one in self.runners if one.fits), key=lambda one: one.cost)
        return [(one.entry, one.fits[-1]) for one in begun if one is begun[0] or self._left(one) <= self._behind()]


@dataclass
class _Runner:
    """A fit on its way, with its last two steps."""

    entry: Entry
    steps: Iterator[Fit]
    fits: list[Fit] = field(default_factory=list)
    taken: int = 0

    @property
    def cost(self) -> float:
        """Of the last step; infinite before the first."""
        return self.fits[-1].cost if self.fits else np.inf

    def at_the_same(self, other: _Runner) -> bool:
        """Whether two fits of the same suspects, each begun, have come to the same."""
        if self is other or self.entry.names != other.entry.names:
            return False
        return bool(np.abs(self.fits[-1].unit - other.fits[-1].unit).max() <= SAME)

    def step(self) -> bool:
        """Whether there was another step."""
        try:
            self.fits = [*self.fits[-1:], next(self.steps)]
        except (StopIteration, *UNFIT):
            return False
        self.taken += 1
        return True


def _from_estimates(subject: Subject, stack: Stack, evaluator: Evaluator, begun: Fit, entry: Entry) -> Iterator[Fit]:
    """Fits of the nominal model with the suspects of ``entry``; CannotBeginError where they cannot begin."""
    suspects = [trial.suspect for trial in entry.trials]
    model = subject.extended([suspect.name for suspect in suspects])
    free = (*begun.problem.free, *(gene.name for suspect in suspects for gene in suspect.genes))
    problem = Problem(model, stack.recordings, free, base_genome(model, begun.problem.base.as_dict()), stack.axes)
    return thoroughly(subject, stack, problem, evaluator, np.concatenate([begun.unit, entry.unit]), STEPS)
