"""Evaluators (in this process, in worker processes, or on a Ray cluster), and the state machine of a job."""

from wingfit.workers.errors import EvaluationInterruptedError, EvaluatorClosedError, WorkerLostError
from wingfit.workers.factory import EvaluatorKind, RunningEvaluator, make_evaluator

__all__ = [
    "EvaluationInterruptedError",
    "EvaluatorClosedError",
    "EvaluatorKind",
    "RunningEvaluator",
    "WorkerLostError",
    "make_evaluator",
]
