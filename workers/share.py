"""Common code of worker processes: priority and threads, a cache of problems, and tasks that can be sent to them."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
    """Set the environment for child processes: one computing thread each, because they share the processors.

    Numerical libraries read the setting when they are loaded. ``more`` are further variables.
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
    """Raise the niceness of this thread, and of what it starts, to at least ``NICENESS``: the API has priority."""
    this = threading.get_native_id()
    with suppress(OSError):  # on systems that know no niceness of threads
        os.setpriority(os.PRIO_PROCESS, this, max(NICENESS, os.getpriority(os.PRIO_PROCESS, this)))


@dataclass(frozen=True)
class Task:
    """A unit of work with ``values``, its rows (individuals x genes) of the batch; can be sent to another process."""

    unit: Unit
    values: npt.NDArray[np.float64]

    @classmethod
    def cut(cls, batch: npt.NDArray[np.float64], unit: Unit) -> Task:
        """The task that evaluates rows ``unit.start`` to ``unit.stop`` of ``batch`` (individuals x genes)."""
        rows = batch[unit.start : unit.stop]
        return cls(Unit(0, len(rows), unit.recording), rows)

    def run(self, problem: Problem, *, residuals: bool) -> Misfit:
        """Misfits of the task's individuals; a copy is evaluated, because arrays in shared memory may be read-only."""
        return run_unit(problem, np.array(self.values), self.unit, residuals=residuals)
