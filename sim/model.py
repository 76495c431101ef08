"""The interface of a simulated rig; calibration and diagnosis use nothing else of the simulators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from wingfit.records import Gene, Recording
from wingfit.records.array_types import Array as Array
from wingfit.records.array_types import ArrayLike


class Solution(NamedTuple):
    """How one individual was solved: steps of a beat, beats simulated, estimated largest error of a marker in m."""

    steps: int
    beats: int
    error: float


@dataclass(frozen=True)
class Observation:
    """What a batch of B individuals would have been recorded as.

    ``channels`` has shape [B, T, C] in the layout of the recording; a failed individual's row is NaN and its entry in
    ``reasons`` says why (None for a good one). ``solutions`` say how, where a model tells.
    """

    channels: Array
    reasons: tuple[str | None, ...]
    solutions: tuple[Solution, ...] = ()


class Model(Protocol):
    """A simulated rig."""

    @property
    def genes(self) -> tuple[Gene, ...]:
        """All genes of the model, in the order of the columns of a genome batch."""
        ...

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the genes that a calibration searches where the user names none."""
        ...

    def observe(self, genomes: Array, recording: Recording) -> Observation:
        """Simulate ``genomes`` [B, G] under the recording's condition, sampled and aligned like the recording."""
        ...


def genome_batch(genes: Sequence[Gene], genomes: ArrayLike) -> Array:
    """Return ``genomes`` as a contiguous [B, G] float array; ValueError when the shape does not fit the genes."""
    batch = np.ascontiguousarray(np.atleast_2d(np.asarray(genomes, float)))
    if batch.ndim != 2 or batch.shape[1] != len(genes):
        raise ValueError(f"a genome batch needs shape [B, {len(genes)}], got {list(np.shape(genomes))}")
    return batch
