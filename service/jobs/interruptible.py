"""An evaluator whose calls can be given up: a batch may take minutes, and a worker may hang."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

import numpy.typing as npt

from wingfit.calibration.problem import Evaluation, Problem
from wingfit.service.jobs.job_kind import InterruptedStepError
from wingfit.workers import RunningEvaluator

LOOK_SECONDS = 0.2


class InterruptibleEvaluator:
    """Evaluates in a thread of its own, and leaves that alone once ``interrupted`` says so.

    The evaluator is told as well: it drops what no worker has begun. But it may hang itself, and is not waited for.
    """

    def __init__(self, evaluator: RunningEvaluator, interrupted: Callable[[], bool]) -> None:
        self._evaluator, self._interrupted = evaluator, interrupted

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Misfits of ``values`` [B, F]; InterruptedStepError once interrupted, whatever the evaluator does."""
        answers: queue.SimpleQueue[Evaluation | BaseException] = queue.SimpleQueue()
        # Remembered for the thread that is left alone: whoever interrupts may forget it.
        left = threading.Event()

        def work() -> None:
            try:
                evaluate = self._evaluator.evaluate
                answers.put(evaluate(problem, values, residuals=residuals, interrupted=left.is_set))
            except BaseException as error:
                answers.put(error)

        if self._interrupted():
            raise InterruptedStepError
        threading.Thread(target=work, name=f"{threading.current_thread().name}-batch", daemon=True).start()
        while True:
            try:
                answer = answers.get(timeout=LOOK_SECONDS)
            except queue.Empty:
                if self._interrupted():
                    left.set()
                    raise InterruptedStepError from None
                continue
            if isinstance(answer, BaseException):
                raise answer
            return answer

    def close(self) -> None:
        """Leave the evaluator to whoever made it."""
