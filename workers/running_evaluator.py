"""The base of all evaluators: cuts a batch into tasks, refuses calls once closed, and collects the results."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal

import numpy.typing as npt

from wingfit.calibration.evaluator import as_batch, gather, units
from wingfit.calibration.problem import Evaluation, Misfit, Problem
from wingfit.workers.errors import EvaluationInterruptedError, EvaluatorClosedError
from wingfit.workers.share import Task
from wingfit.workers.watch import Standing, never

EvaluatorKind = Literal["in_process", "processes", "ray"]
Interrupted = Callable[[], bool]


class RunningEvaluator(ABC):
    """Base class: evaluates batches; a subclass runs their tasks in this process, in worker processes or on Ray."""

    kind: EvaluatorKind
    _closed = False

    @property
    @abstractmethod
    def workers(self) -> int:
        """Number of tasks that can be evaluated at the same time."""

    @property
    @abstractmethod
    def standing(self) -> Standing:
        """Number of living workers, and counts of lost ones."""

    def evaluate(
        self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False, interrupted: Interrupted = never
    ) -> Evaluation:
        """Misfits of ``values`` (individuals x genes) to every recording of the problem; several threads may call.

        EvaluationInterruptedError is raised soon after ``interrupted`` returns True; tasks not yet started are dropped.
        """
        batch = as_batch(values)
        tasks = [Task.cut(batch, unit) for unit in units(problem, len(batch))]
        return gather(problem, self._misfits(problem, tasks, residuals, interrupted))

    @abstractmethod
    def close(self) -> None:
        """Release processes and memory; further calls are errors."""

    @abstractmethod
    def _misfits(self, problem: Problem, tasks: list[Task], residuals: bool, interrupted: Interrupted) -> list[Misfit]:
        """The result of each task, in their order."""

    def _check(self, interrupted: Interrupted = never) -> None:
        """Raise if the evaluator was closed or the call is interrupted."""
        if self._closed:
            raise EvaluatorClosedError(self.kind)
        if interrupted():
            raise EvaluationInterruptedError
