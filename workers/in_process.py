"""Evaluates individuals in the thread of the caller; all other evaluators must return bit-identical numbers."""

from __future__ import annotations

from typing import Literal

from wingfit.calibration.problem import Misfit, Problem
from wingfit.workers.running_evaluator import Interrupted, RunningEvaluator
from wingfit.workers.share import Task
from wingfit.workers.watch import Standing


class InProcessEvaluator(RunningEvaluator):
    """Evaluates the units of work of a batch (some individuals against one recording each) one after the other."""

    kind: Literal["in_process"] = "in_process"
    workers = 1

    @property
    def standing(self) -> Standing:
        """One living worker (this process), no lost ones."""
        return Standing(self.workers)

    def _misfits(self, problem: Problem, tasks: list[Task], residuals: bool, interrupted: Interrupted) -> list[Misfit]:
        done: list[Misfit] = []
        for task in tasks:
            self._check(interrupted)
            done.append(task.run(problem, residuals=residuals))
        return done

    def close(self) -> None:
        """Refuse further calls; a call in progress raises EvaluatorClosedError before its next unit."""
        self._closed = True
