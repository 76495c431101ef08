"""The interface through which a search simulates individuals (genomes), and how every implementation splits the work.

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
from wingfit.sim.model import DifferentiableModel


class Evaluator(Protocol):
    """Evaluates batches of individuals; the implementation decides where the work runs."""

    def evaluate(self, problem: Problem, values: ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Return the misfits of B individuals, ``values`` [B, F] of the free genes, to every recording of ``problem``.

        With ``residuals``, simulated minus recorded values are returned as well.
        """
        ...

    def close(self) -> None:
        """Release processes and memory; the evaluator must not be called afterwards."""
        ...


@dataclass(frozen=True)
class Unit:
    """One piece of work: individuals ``start`` to ``stop`` (excluded) of a batch, on recording number ``recording``."""

    start: int
    stop: int
    recording: int


def units(problem: Problem, individuals: int) -> list[Unit]:
    """Split a batch of so many ``individuals`` into units of one recording and at most LANES individuals each.

    The individuals of a model that is differentiated (``DifferentiableModel.tangent``) stay together.
    """
    size = individuals if _differentiated(problem) else LANES
    return [
        Unit(start, min(start + size, individuals), recording)
        for recording in range(len(problem.recordings))
        for start in range(0, individuals, size)
    ]


def distinct(problem: Problem, batch: Array) -> tuple[Array, list[int]]:
    """Return the individuals of ``batch`` [B, F] without repetitions [D, F], and the place of each of the B among them.

    A batch for a model that is differentiated stays as it is, since its rows are a genome and its neighbours.
    """
    if _differentiated(problem):
        return batch, list(range(len(batch)))
    places: dict[bytes, int] = {}
    of_each = [places.setdefault(row.tobytes(), len(places)) for row in batch]
    first = [of_each.index(place) for place in range(len(places))]
    return batch[first], of_each


def _differentiated(problem: Problem) -> bool:
    return isinstance(problem.model, DifferentiableModel) and problem.model.differentiates


@one_blas_thread
def run_unit(problem: Problem, values: Array, unit: Unit, *, residuals: bool = False) -> Misfit:
    """Return the misfit of the individuals of ``unit`` in the batch ``values`` [B, F], with residuals if requested."""
    return misfit(problem, values[unit.start : unit.stop], unit.recording, residuals=residuals)


def gather(problem: Problem, done: Sequence[Misfit]) -> Evaluation:
    """Join the results ``done`` of all units, in the order of :func:`units`, to the evaluation of the batch."""
    per = len(done) // len(problem.recordings)
    return Evaluation(tuple(concatenate(done[r * per : (r + 1) * per]) for r in range(len(problem.recordings))))


def as_batch(values: ArrayLike) -> Array:
    """Convert ``values`` to a contiguous array [B, F], B individuals and F genes; ValueError if B is 0."""
    batch = np.ascontiguousarray(np.atleast_2d(np.asarray(values, float)))
    if batch.ndim != 2 or not len(batch):
        raise ValueError(f"a batch needs shape [B, F] with B >= 1, got {list(np.shape(values))}")
    return batch
