"""What all evaluators do: cut a batch into tasks, refuse calls once closed, and collect the results."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy.typing as npt

from wingfit.calibration.evaluator import as_batch, gather, units
from wingfit.calibration.problem import Evaluation, Misfit, Problem
from wingfit.workers.errors import EvaluationInterruptedError, EvaluatorClosedError
from wingfit.workers.share import Task
from wingfit.workers.watch import never

Interrupted = Callable[[], bool]


class BatchEvaluator(ABC):
    """Evaluates batches; subclasses say where the tasks of a batch run."""

    kind: str
    _closed = False

    def evaluate(
        self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False, interrupted: Interrupted = never
    ) -> Evaluation:
        """Misfits of ``values`` (individuals x genes) to every recording; several threads may call."""
        batch = as_batch(values)
        tasks = [Task.cut(batch, unit) for unit in units(problem, len(batch))]
        return gather(problem, self._misfits(problem, tasks, residuals, interrupted))

    @abstractmethod
    def _misfits(self, problem: Problem, tasks: list[Task], residuals: bool, interrupted: Interrupted) -> list[Misfit]:
        """The result of each task, in their order."""

    def _check(self, interrupted: Interrupted = never) -> None:
        """Raise if the evaluator was closed or the call is interrupted."""
        if self._closed:
            raise EvaluatorClosedError(self.kind)
        if interrupted():
            raise EvaluationInterruptedError
