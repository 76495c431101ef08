"""Errors of the evaluators, as opposed to errors of the model."""

from __future__ import annotations


class EvaluatorClosedError(RuntimeError):
    """The evaluator was closed before or during the call."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"the {kind} evaluator is closed; make a new one with workers.make_evaluator")


class EvaluationInterruptedError(RuntimeError):
    """The caller interrupted the call. Units that have started run to their end; their results are dropped."""


class WorkerLostError(RuntimeError):
    """A unit was given up because the processes that evaluated it kept dying."""
