"""The interface through which a search evaluates individuals, and the units of work of every implementation.

Work is cut into units of at most ``LANES`` individuals and one recording, always in the same way, so that every
implementation does the same arithmetic on the same units and returns the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wingfit.calibration.problem import Evaluation, Misfit, Problem, concatenate, misfit
from wingfit.records.array_types import Array, ArrayLike
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.kernels import LANES


class Evaluator(Protocol):
    """Evaluates batches of individuals; the implementation decides where the work runs."""

    def evaluate(self, problem: Problem, values: ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Misfits of ``values`` [B, F] to every recording of the problem."""
        ...

    def close(self) -> None:
        """Release processes and memory; further calls are errors."""
        ...


@dataclass(frozen=True)
class Unit:
    """One piece of work: individuals ``start`` to ``stop`` of the batch against one recording."""

    start: int
    stop: int
    recording: int


def units(problem: Problem, individuals: int) -> list[Unit]:
    """Cut a batch into units, recording by recording."""
    return [
        Unit(start, min(start + LANES, individuals), recording)
        for recording in range(len(problem.recordings))
        for start in range(0, individuals, LANES)
    ]


@one_blas_thread
def run_unit(problem: Problem, values: Array, unit: Unit, *, residuals: bool = False) -> Misfit:
    """Evaluate one unit of the batch ``values`` [B, F]."""
    return misfit(problem, values[unit.start : unit.stop], unit.recording, residuals=residuals)


def gather(problem: Problem, done: Sequence[Misfit]) -> Evaluation:
    """Assemble results, in the order of :func:`units`, into one evaluation."""
    per = len(done) // len(problem.recordings)
    return Evaluation(tuple(concatenate(done[r * per : (r + 1) * per]) for r in range(len(problem.recordings))))


def as_batch(values: ArrayLike) -> Array:
    """``values`` as a contiguous, non-empty [B, F] array."""
    batch = np.ascontiguousarray(np.atleast_2d(np.asarray(values, float)))
    if batch.ndim != 2 or not len(batch):
        raise ValueError(f"a batch needs shape [B, F] with B >= 1, got {list(np.shape(values))}")
    return batch
