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
from wingfit.inference.differences import NotSimulatedError

SEARCHED = 8  # generations of the search before
MOST = 5  # starts
SHIFT = 0.3  # of a gene between a start and the one added to it, genes scaled to 0..1
APART = 0.1  # largest difference of a gene between two starts, genes scaled to 0..1
AGREE = 1.0  # difference of two negative log-likelihoods up to which they count as the same
FLAT = 4.0  # the same, times the decrease at which iterations end
START_ERRORS = (NotSimulatedError, np.linalg.LinAlgError)  # end one start, not the calibration


@dataclass(frozen=True)
class End:
    """Where Gauss-Newton is from one start: ``cost`` J, sum of squares and misfit (m or N), and values by name.

    ``flat``: decrease of the cost at which iterations end; ``converged``: whether they have ended there.
    """

    cost: float
    fitness: float
    distance: float
    values: dict[str, float]
    flat: float = 0.0
    converged: bool = True  # of earlier versions, which did not store it

    @classmethod
    def of(cls, step: Step) -> End:
        """Return where an iteration ended; its cost is that before the iteration, which is the last of a start."""
        return cls(step.cost, step.fitness, step.distance, step.values, step.flat, step.converged)


@dataclass
class Ends:
    """Progress from start to start; plain numbers, stored as part of a checkpoint.

    ``done``: ends of the starts that have converged, reached the limit of iterations, or got somewhere before they
    failed; ``tried``: number of starts that are over, with those that failed at once; ``present``: where the present
    one is; ``newton``: checkpoint of its iterations; ``iterations``: number of generations of all starts so far;
    ``failures``: why starts failed.
    """

    done: list[dict[str, Any]] = field(default_factory=list)
    tried: int = 0
    present: dict[str, Any] | None = None
    newton: dict[str, Any] | None = None
    iterations: int = 0
    failures: list[str] = field(default_factory=list)

    def best(self) -> End:
        """Return the place with the least cost, also of the present start; ValueError before the first iteration."""
        places = [*self.done, *([self.present] if self.present else [])]
        return min((End(**place) for place in places), key=lambda end: end.cost)

    def add(self, step: Step, last: bool) -> None:
        """Take one more iteration; ``last``: with it, a start has ended."""
        self.present, self.newton, self.iterations = asdict(End.of(step)), step.checkpoint, self.iterations + 1
        if last:
            self.close()

    def fail(self, error: Exception) -> str:
        """End the present start where it is, and return why; one without an iteration leaves no end."""
        self.present = self.present and self.present | {"converged": False}
        self.close()
        self.failures = [*self.failures, str(error)]
        return f"start {self.tried} of Gauss-Newton failed: {error}"

    def close(self) -> None:
        """End the present start where it is."""
        self.done = [*self.done, *([self.present] if self.present else [])]
        self.tried, self.present, self.newton = self.tried + 1, None, None

    @property
    def agreed(self) -> bool:
        """Whether two starts have converged at the least cost of all."""
        ends = [End(**one) for one in self.done]
        if not ends:
            return False
        least = min(ends, key=lambda end: end.cost)
        near = [end for end in ends if end.cost - least.cost <= max(AGREE, FLAT * least.flat)]
        return sum(end.converged for end in near) >= 2

    @property
    def doubt(self) -> str | None:
        """Why the least cost is not confirmed, in words that follow the name of the stage; None if it is."""
        if self.agreed:
            return None
        starts = f"of {self.tried} starts of Gauss-Newton, no two converged at the least cost"
        failed = f" ({len(self.failures)} failed, the first: {self.failures[0]})" if self.failures else ""
        return (
            f"{starts if self.tried > 1 else 'Gauss-Newton had only one start'}{failed}: the minimum is not confirmed; "
            "use a larger population or another seed"
        )


def apart(population: Population) -> list[list[float]]:
    """Return up to MOST individuals (genes scaled to 0..1), best first, that lie APART from each other; none failed.

    Where a population has converged to one place, a start off it is added, to confirm the minimum: each gene is shifted
    by SHIFT, away from the nearer bound.
    """
    chosen: list[list[float]] = []
    usable = [unit for unit, fitness in zip(population.unit, population.fitness, strict=True) if fitness < FAILED]
    for unit in usable:
        if all(np.abs(np.subtract(unit, other)).max() >= APART for other in chosen):
            chosen.append(unit)
        if len(chosen) == MOST:
            break
    if len(chosen) == 1 < min(len(usable), MOST):
        chosen.append([gene + SHIFT if gene <= 0.5 else gene - SHIFT for gene in chosen[0]])
    return chosen


def doubts(checkpoint: dict[str, Any]) -> tuple[str, ...]:
    """Return remarks on the stages of a run whose minimum is not confirmed, from its last ``checkpoint``."""
    stages: dict[str, list[str]] = {}
    for stage, doubt in checkpoint.get("doubts", {}).items():
        stages.setdefault(doubt, []).append(repr(stage))
    return tuple(f"{'stages' if len(of) > 1 else 'stage'} {', '.join(of)}: {doubt}" for doubt, of in stages.items())
