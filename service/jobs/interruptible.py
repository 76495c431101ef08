"""An evaluator whose calls can be interrupted: one batch of simulations may take minutes, and a worker may hang."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import wait
from functools import partial

import numpy.typing as npt

from wingfit.calibration.problem import Evaluation, Problem
from wingfit.service.http import threads
from wingfit.service.jobs.job_kind import InterruptedStepError
from wingfit.workers import RunningEvaluator

LOOK_SECONDS = 0.2


class InterruptibleEvaluator:
    """Evaluates in a separate thread, and no longer waits for that thread once ``interrupted()`` returns True.

    ``evaluator`` is then notified, and drops the simulations that no worker has started.
    """

    def __init__(self, evaluator: RunningEvaluator, interrupted: Callable[[], bool]) -> None:
        self._evaluator, self._interrupted = evaluator, interrupted

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Return the misfits of ``values`` [B, F] (B individuals, F free genes) to the recordings of ``problem``.

        ``residuals``: return residuals too. InterruptedStepError soon after an interruption, even if a worker hangs.
        """
        if self._interrupted():
            raise InterruptedStepError
        # Kept for the abandoned thread: ``interrupted`` may return False again later.
        left = threading.Event()
        batch = partial(self._evaluator.evaluate, problem, values, residuals=residuals, interrupted=left.is_set)
        answer = threads.call(f"{threading.current_thread().name}-batch", batch)
        while not wait([answer], LOOK_SECONDS).done:
            if self._interrupted():
                left.set()
                raise InterruptedStepError
        return answer.result()

    def close(self) -> None:
        """Do nothing: the caller that made the evaluator closes it."""
