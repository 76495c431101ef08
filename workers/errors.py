"""Errors of the evaluators; errors of the simulated model are raised as they are."""

from __future__ import annotations


class EvaluatorClosedError(RuntimeError):
    """The evaluator was closed before or during the call."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"the {kind} evaluator is closed; make a new one with workers.make_evaluator")


class EvaluationInterruptedError(RuntimeError):
    """The caller interrupted a call of ``evaluate``; simulations that have begun run to their end, without a result."""


class WorkerLostError(RuntimeError):
    """A unit of work (some individuals against one recording) was given up, because its processes kept dying."""
