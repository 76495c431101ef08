"""Errors of the evaluators, as opposed to errors of the model."""

from __future__ import annotations


class EvaluatorClosedError(RuntimeError):
    """The evaluator was closed before or during the call."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"the {kind} evaluator is closed; make a new one with workers.make_evaluator")


class EvaluationInterruptedError(RuntimeError):
    """The caller interrupted the call. Simulations in progress run to their end; their results are dropped."""


class WorkerLostError(RuntimeError):
    """A unit of work (some individuals against one recording) was given up: the processes evaluating it kept dying."""
