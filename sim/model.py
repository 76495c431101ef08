"""The interface of a simulated rig. Calibration and diagnosis use the simulators through this interface only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from wingfit.records import Gene
from wingfit.records.array_types import Array as Array
from wingfit.records.array_types import ArrayLike


class Solution(NamedTuple):
    """How the periodic beat of one individual was computed.

    ``steps``: time steps per beat; ``beats``: beats simulated until the motion was periodic; ``error``: estimated
    largest error of a marker, m (NaN if the number of steps was given).
    """

    steps: int
    beats: int
    error: float


@dataclass(frozen=True)
class Observation:
    """Simulated recordings of a batch of B individuals.

    Attributes:
        channels: [B, T, C] values at the T samples and C channels of the recording; NaN for an individual that failed.
        reasons: [B] why an individual failed; None where it did not.
        solutions: [B] how each was computed; empty for a model that does not report it.
    """

    channels: Array
    reasons: tuple[str | None, ...]
    solutions: tuple[Solution, ...] = ()


class Model(Protocol):
    """A simulated rig with its genes: what a calibration or a diagnosis needs of it."""

    @property
    def genes(self) -> tuple[Gene, ...]:
        """All genes of the model, in the order of the columns of a batch of genomes."""
        ...

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the genes that a calibration searches where the user names none."""
        ...

    def observe(self, genomes: Array, recording: Any) -> Observation:
        """Simulate ``genomes`` [B, G] under the recording's condition, at the recording's samples and channels.

        ``recording`` is one of the rig that is simulated: of a wing, a vehicle, or a series. Tracks are also aligned in
        phase with it; forces are filtered as it was.
        """
        ...


@runtime_checkable
class DifferentiableModel(Model, Protocol):
    """A model that starts simulations from a known motion, and differentiates the motion that it computes."""

    @property
    def differentiates(self) -> bool:
        """Whether this is the :meth:`tangent` of a model, whose batches must not be split."""
        ...

    def beside(self, genome: ArrayLike) -> Model:
        """Return the same model, whose simulations start from the motion of ``genome`` [G] without effects."""
        ...

    def tangent(self, genome: ArrayLike) -> Model:
        """Return the same model for individuals that are very close to the first of their batch.

        They differ from the first by the derivative of its computed motion times their distance, however small this is.
        An individual fails, with a reason, where the motion has no derivative in its direction. ``genome`` [G]: from
        its motion that of the first is found.
        """
        ...


def genome_batch(genes: Sequence[Gene], genomes: ArrayLike) -> Array:
    """Return ``genomes`` as a contiguous float array [B, G]; a single genome [G] becomes [1, G].

    ValueError if G is not the number of ``genes``.
    """
    batch = np.ascontiguousarray(np.atleast_2d(np.asarray(genomes, float)))
    if batch.ndim != 2 or batch.shape[1] != len(genes):
        raise ValueError(f"a genome batch needs shape [B, {len(genes)}], got {list(np.shape(genomes))}")
    return batch
