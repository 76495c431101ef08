"""Evaluators (in this process, in worker processes, or on a Ray cluster), and the state machine of a job."""

from wingfit.workers.errors import EvaluationInterruptedError, EvaluatorClosedError, WorkerLostError
from wingfit.workers.factory import make_evaluator
from wingfit.workers.running_evaluator import EvaluatorKind, RunningEvaluator

__all__ = [
    "EvaluationInterruptedError",
    "EvaluatorClosedError",
    "EvaluatorKind",
    "RunningEvaluator",
    "WorkerLostError",
    "make_evaluator",
]
