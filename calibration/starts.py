"""Gauss-Newton from several starts: from the best of a population, until two of them end at the same least cost.

Gauss-Newton ends at the minimum of the valley in which it starts. The best individuals of a short search that lie well
apart are tried in turn; that two of them agree about the least cost is taken as a sign that it is the least of all.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from wingfit.calibration.estimates.likelihood import Step
from wingfit.calibration.genetic import FAILED, Population

SEARCHED = 8  # generations of the search before
MOST = 5  # starts
APART = 0.1  # largest difference of a gene between two starts, genes scaled to 0..1
AGREE = 1.0  # difference of two negative log-likelihoods up to which they count as the same
FLAT = 4.0  # the same, times the decrease at which iterations end


@dataclass(frozen=True)
class End:
    """Where Gauss-Newton is from one start: ``cost`` J, sum of squares and misfit (m or N), and values by name.

    ``flat``: decrease of the cost at which iterations end.
    """

    cost: float
    fitness: float
    distance: float
    values: dict[str, float]
    flat: float = 0.0

    @classmethod
    def of(cls, step: Step) -> End:
        """Return where an iteration ended; its cost is that before the iteration, which is the last of a start."""
        return cls(step.cost, step.fitness, step.distance, step.values, step.flat)


@dataclass
class Ends:
    """Progress from start to start; plain numbers, stored as part of a checkpoint.

    ``done``: ends of the starts that have converged, or got somewhere before they failed; ``tried``: number of starts
    that are over, with those that failed at once; ``present``: where the present one is; ``newton``: checkpoint of its
    iterations; ``iterations``: number of iterations of all starts so far.
    """

    done: list[dict[str, Any]] = field(default_factory=list)
    tried: int = 0
    present: dict[str, Any] | None = None
    newton: dict[str, Any] | None = None
    iterations: int = 0

    def best(self) -> End:
        """Return the place with the least cost, also of the present start; ValueError before the first iteration."""
        places = [*self.done, *([self.present] if self.present else [])]
        return min((End(**place) for place in places), key=lambda end: end.cost)

    def add(self, step: Step, last: bool) -> None:
        """Take one more iteration; ``last``: with it, a start has ended."""
        self.present, self.newton, self.iterations = asdict(End.of(step)), step.checkpoint, self.iterations + 1
        if last:
            self.close()

    def close(self) -> None:
        """End the present start where it is; one that failed before its first iteration leaves no end."""
        self.done = [*self.done, *([self.present] if self.present else [])]
        self.tried, self.present, self.newton = self.tried + 1, None, None

    @property
    def agreed(self) -> bool:
        """Whether two starts have ended at the least cost."""
        ends = sorted((End(**one) for one in self.done), key=lambda end: end.cost)[:2]
        return len(ends) == 2 and bool(ends[1].cost - ends[0].cost <= max(AGREE, FLAT * ends[0].flat))


def apart(population: Population) -> list[list[float]]:
    """Return up to MOST individuals (genes scaled to 0..1), best first, that lie APART from each other; none failed."""
    chosen: list[list[float]] = []
    for unit, fitness in zip(population.unit, population.fitness, strict=True):
        if fitness < FAILED and all(np.abs(np.subtract(unit, other)).max() >= APART for other in chosen):
            chosen.append(unit)
        if len(chosen) == MOST:
            break
    return chosen
