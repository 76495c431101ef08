"""Measures how long the simulator's kernels compute in this process, and how many of their lanes are in use."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import State
from wingfit.sim.solver.settle import Group


@dataclass
class KernelTime:
    """What the kernels did: beats of groups of LANES individuals, and their processor time.

    ``beats`` and ``seconds`` count all groups; ``lanes`` adds up the individuals of each beat that are neither
    periodic nor failed; ``alone`` is the time of groups of which only one individual is left.
    """

    beats: int = 0
    seconds: float = 0.0
    lanes: int = 0
    alone: float = 0.0

    @property
    def lanes_in_use_percent(self) -> float:
        """Lanes in use per beat, of all."""
        return 100 * self.lanes / (LANES * max(1, self.beats))


@contextmanager
def kernel_time() -> Iterator[KernelTime]:
    """Context in which all groups are measured; yields the sums so far."""
    found, beat = KernelTime(), Group.beat

    def measured(self: Group, table: npt.NDArray[np.float64]) -> State:
        left = sum(course.reason is None and course.trace is None for course in self.courses)
        # A derivative's beats start from a finished course; all its individuals are in use.
        used, began = left or len(self.courses), time.thread_time()
        start = beat(self, table)
        spent = time.thread_time() - began
        found.beats, found.seconds, found.lanes = found.beats + 1, found.seconds + spent, found.lanes + used
        found.alone += spent if used == 1 else 0.0
        return start

    Group.beat = measured  # type: ignore[method-assign]
    try:
        yield found
    finally:
        Group.beat = beat  # type: ignore[method-assign]
