"""Evaluation in the caller's own thread. The other evaluators must return the same bits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy.typing as npt

from wingfit.calibration.evaluator import as_batch, gather, run_unit, units
from wingfit.calibration.problem import Evaluation, Misfit, Problem
from wingfit.workers.errors import EvaluationInterruptedError, EvaluatorClosedError
from wingfit.workers.watch import Standing, never


class InProcessEvaluator:
    """Evaluates one unit after the other."""

    kind: Literal["in_process"] = "in_process"
    workers = 1

    def __init__(self) -> None:
        self._closed = False

    @property
    def standing(self) -> Standing:
        """One worker: this process."""
        return Standing(self.workers)

    def evaluate(
        self,
        problem: Problem,
        values: npt.ArrayLike,
        *,
        residuals: bool = False,
        interrupted: Callable[[], bool] = never,
    ) -> Evaluation:
        """Misfits of ``values`` [B, F] to every recording of the problem."""
        batch = as_batch(values)
        done: list[Misfit] = []
        for unit in units(problem, len(batch)):
            if self._closed:
                raise EvaluatorClosedError(self.kind)
            if interrupted():
                raise EvaluationInterruptedError
            done.append(run_unit(problem, batch, unit, residuals=residuals))
        return gather(problem, done)

    def close(self) -> None:
        """Refuse further calls; a call in progress ends after its current unit."""
        self._closed = True
