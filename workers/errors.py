"""What can go wrong with the machinery, as against the model."""

from __future__ import annotations


class EvaluatorClosedError(RuntimeError):
    """The evaluator was closed before or during the call."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"the {kind} evaluator is closed; make a new one with workers.make_evaluator")


class EvaluationInterruptedError(RuntimeError):
    """The call was given up because its caller asked for it; what had begun ends by itself, and nobody waits for it."""


class WorkerLostError(RuntimeError):
    """Work was given up because the processes that did it kept dying."""
