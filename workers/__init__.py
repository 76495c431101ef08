"""Evaluators, which simulate individuals in this process, in worker processes or on Ray; the state machine of a job.

An individual is one value for every gene. Evaluators split a batch of individuals into units of work: a few
individuals against one recording each.
"""

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
