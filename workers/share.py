"""Functions for all worker processes: low priority, one computing thread each, and tasks that can be sent to them."""

from __future__ import annotations

import hashlib
import os
import pickle
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from wingfit.calibration.evaluator import Unit, run_unit
from wingfit.calibration.problem import Misfit, Problem
from wingfit.records import AnyRecording

NICENESS = 10
PROBLEMS_KEPT = 8
THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_environment = threading.Lock()
_received: WeakValueDictionary[bytes, AnyRecording] = WeakValueDictionary()


@contextmanager
def child_environment(**more: str) -> Iterator[None]:
    """Set environment variables for the child processes that the with-block starts.

    They give each child one thread for numerical libraries (which read the variables when loaded), because the children
    share the processors. ``more``: further variables.
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
    """Lower the priority of this thread, and of all that it starts, below that of the server's API."""
    this = threading.get_native_id()
    with suppress(OSError):  # on systems that know no niceness of threads
        os.setpriority(os.PRIO_PROCESS, this, max(NICENESS, os.getpriority(os.PRIO_PROCESS, this)))


def received(problem: Problem) -> Problem:
    """Return ``problem``, which another process sent, with the recordings of earlier problems where they are equal.

    So what models compute once for a recording, such as its low-pass, is not computed again for each problem.
    """
    digests = (hashlib.sha256(pickle.dumps(one, pickle.HIGHEST_PROTOCOL)).digest() for one in problem.recordings)
    known = (_received.setdefault(digest, one) for digest, one in zip(digests, problem.recordings, strict=True))
    return replace(problem, recordings=tuple(known))


@dataclass(frozen=True)
class Task:
    """A unit of work (some individuals against one recording) that can be sent to another process.

    ``values`` [U, F] holds the free genes of the U individuals; ``unit`` refers to these rows, 0 to U.
    """

    unit: Unit
    values: npt.NDArray[np.float64]

    @classmethod
    def cut(cls, batch: npt.NDArray[np.float64], unit: Unit) -> Task:
        """Return the task that evaluates rows ``unit.start`` to ``unit.stop`` of ``batch`` [B, F] (B individuals)."""
        rows = batch[unit.start : unit.stop]
        return cls(Unit(0, len(rows), unit.recording), rows)

    def run(self, problem: Problem, *, residuals: bool) -> Misfit:
        """Return the misfits of the individuals; ``values`` are copied, as arrays in shared memory may be read-only."""
        return run_unit(problem, np.array(self.values), self.unit, residuals=residuals)
