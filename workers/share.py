"""What worker processes of every kind share: manners, a memory of problems, and tasks that can travel."""

from __future__ import annotations

import os
import pickle
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.calibration.evaluator import Unit, run_unit
from wingfit.calibration.problem import Misfit, Problem

NICENESS = 10
PROBLEMS_KEPT = 8
THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_environment = threading.Lock()


@contextmanager
def child_environment(**more: str) -> Iterator[None]:
    """Give each process that is started inside one computing thread: they share the processors.

    Numerical libraries read the setting when they load: in a spawned process, before any code of ours runs.
    ``more`` are further variables for those processes.
    """
    settings = dict.fromkeys(THREAD_SETTINGS, "1") | more
    with _environment:
        before = {name: os.environ.get(name) for name in settings}
        os.environ.update(settings)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


def lower_priority() -> None:
    """Yield to the API: run this process at a niceness of at least ``NICENESS``."""
    os.nice(max(0, NICENESS - os.nice(0)))


@dataclass(frozen=True)
class Task:
    """A unit with its own rows of the batch, so that it can travel alone."""

    unit: Unit
    values: npt.NDArray[np.float64]

    @classmethod
    def cut(cls, batch: npt.NDArray[np.float64], unit: Unit) -> Task:
        """Take the rows of ``unit`` out of ``batch``."""
        rows = batch[unit.start : unit.stop]
        return cls(Unit(0, len(rows), unit.recording), rows)

    def run(self, problem: Problem, *, residuals: bool) -> Misfit:
        """Evaluate; on a copy, because what arrives through shared memory may be read-only."""
        return run_unit(problem, np.array(self.values), self.unit, residuals=residuals)


class ProblemMemory:
    """The problems used last, by key. Held by one worker; not for several threads."""

    def __init__(self, kept: int = PROBLEMS_KEPT) -> None:
        self._kept = kept
        self._problems: OrderedDict[str, Problem] = OrderedDict()

    def get(self, key: str, fetch: Callable[[], bytes]) -> Problem:
        """Return the problem called ``key``; ``fetch`` brings it, pickled, when it is not remembered."""
        if key not in self._problems:
            self._problems[key] = pickle.loads(fetch())  # noqa: S301  comes from the process that owns this worker
            while len(self._problems) > self._kept:
                self._problems.popitem(last=False)
        self._problems.move_to_end(key)
        return self._problems[key]
