"""Bundle what every fit of a diagnosis needs: the rig, its recordings, and an evaluator."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.subject import Subject
from wingfit.records import Genome
from wingfit.records.array_types import Array, Float
from wingfit.sim.model import Model


@dataclass(frozen=True)
class FitContext:
    """The rig ``subject``, its whitened recordings ``data``, and the evaluator that simulates individuals."""

    subject: Subject
    data: WhitenedData
    evaluator: Evaluator

    def finer(self) -> Iterator[FitContext]:
        """Return this context with each finer discretisation of the rig, as they are tried."""
        return (replace(self, subject=finer) for finer in self.subject.finer_subjects())

    def problem(self, model: Model, free: tuple[str, ...], base: Genome) -> Problem:
        """Return the problem of fitting genes ``free`` of ``model`` to all recordings; ``base`` has the other genes."""
        return Problem(model, self.data.recordings, free, base, self.data.axes)

    def evaluate(
        self, problem: Problem, values: Float[Array, "B F"]
    ) -> tuple[Float[Array, "B D"], tuple[str | None, ...], list[Array]]:
        """Simulate ``values`` [B, F] of F free genes; returns the same as :meth:`WhitenedData.evaluate`."""
        return self.data.evaluate(problem, self.evaluator, values)
