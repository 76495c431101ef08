"""Base class of all evaluators: splits a batch into tasks, collects the results, refuses calls once closed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal

import numpy.typing as npt

from wingfit.calibration.evaluator import as_batch, distinct, gather, units
from wingfit.calibration.problem import Evaluation, Misfit, Problem
from wingfit.workers.errors import EvaluationInterruptedError, EvaluatorClosedError
from wingfit.workers.share import Task
from wingfit.workers.watch import Standing, never

EvaluatorKind = Literal["in_process", "processes", "ray"]
Interrupted = Callable[[], bool]


class RunningEvaluator(ABC):
    """Base class of evaluators; a subclass runs the tasks of a batch in this process, in worker processes or on Ray."""

    kind: EvaluatorKind
    _closed = False

    @property
    @abstractmethod
    def workers(self) -> int:
        """Number of tasks that can be evaluated at the same time."""

    @property
    @abstractmethod
    def standing(self) -> Standing:
        """Number of living workers, and counts of lost ones (died, hung)."""

    def evaluate(
        self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False, interrupted: Interrupted = never
    ) -> Evaluation:
        """Simulate the individuals ``values`` [B, F] (B individuals, F free genes), and return their misfits.

        There is a misfit to every recording of ``problem``, with the residuals if ``residuals``. Individuals that are
        equal are simulated once. Several threads may call. EvaluationInterruptedError is raised soon after
        ``interrupted()`` returns True; waiting tasks are dropped.
        """
        batch, place = distinct(problem, as_batch(values))
        tasks = [Task.cut(batch, unit) for unit in units(problem, len(batch))]
        found = gather(problem, self._misfits(problem, tasks, residuals, interrupted))
        return found if len(batch) == len(place) else found.taken(place)

    @abstractmethod
    def close(self) -> None:
        """Release processes and memory; further calls raise EvaluatorClosedError."""

    @abstractmethod
    def _misfits(self, problem: Problem, tasks: list[Task], residuals: bool, interrupted: Interrupted) -> list[Misfit]:
        """Evaluate ``tasks``, and return their misfits in the same order; see :meth:`evaluate` for the arguments."""

    def _check(self, interrupted: Interrupted = never) -> None:
        """Raise an error if the evaluator was closed, or if ``interrupted()`` returns True."""
        if self._closed:
            raise EvaluatorClosedError(self.kind)
        if interrupted():
            raise EvaluationInterruptedError
