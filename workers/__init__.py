"""Where evaluations run: in this process, in worker processes or on a Ray cluster; and the life of a job."""

from workers.errors import EvaluationInterruptedError, EvaluatorClosedError, WorkerLostError
from workers.factory import EvaluatorKind, RunningEvaluator, make_evaluator

__all__ = [
    "EvaluationInterruptedError",
    "EvaluatorClosedError",
    "EvaluatorKind",
    "RunningEvaluator",
    "WorkerLostError",
    "make_evaluator",
]
