"""The only definition of misfit, and what an evaluator evaluates: a model, recordings and the genes that are free."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from records import Genome, Recording
from sim.model import Model

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """Everything that turns values of the free genes into misfits. Picklable; sent to workers once.

    ``free`` are the genes searched, in the order of the columns of a batch; all others keep their value in ``base``.
    """

    model: Model
    recordings: tuple[Recording, ...]
    free: tuple[str, ...]
    base: Genome

    @cached_property
    def key(self) -> str:
        """Content hash, by which workers cache problems."""
        return hashlib.sha256(pickle.dumps((self.model, self.recordings, self.free, self.base), 5)).hexdigest()

    def genomes(self, values: npt.ArrayLike) -> Array:
        """Full genomes [B, G] for ``values`` [B, F] of the free genes."""
        batch = np.atleast_2d(np.asarray(values, float))
        if batch.shape[1] != len(self.free):
            raise ValueError(f"values need {len(self.free)} columns ({', '.join(self.free)}), got {batch.shape[1]}")
        names = [gene.name for gene in self.model.genes]
        full = np.tile([self.base[name] for name in names], (len(batch), 1))
        full[:, [names.index(name) for name in self.free]] = batch
        return full


@dataclass(frozen=True)
class Misfit:
    """Misfit of B individuals to one recording.

    Attributes:
        squares: [B] sum over frames and markers of squared distance, m^2 (thesis Eq. 14); inf for a failed individual.
        distance: [B] mean distance per marker and frame, m; inf for a failed individual.
        samples: number of (frame, marker) pairs compared.
        reasons: per individual, why it failed, else None.
        residuals: [B, T, C] simulated minus recorded, m, NaN where not recorded; None unless asked for.
    """

    squares: Array
    distance: Array
    samples: int
    reasons: tuple[str | None, ...]
    residuals: Array | None = None


def misfit(problem: Problem, values: npt.ArrayLike, recording: int, *, residuals: bool = False) -> Misfit:
    """Misfit of ``values`` [B, F] to the problem's recording number ``recording``."""
    record = problem.recordings[recording]
    observed = problem.model.observe(problem.genomes(values), record)
    difference = observed.channels - record.values
    square = difference.reshape(len(difference), -1, 3) ** 2
    distance2 = square.sum(axis=2)
    seen = np.isfinite(record.positions).all(axis=2).ravel()
    kept = distance2[:, seen]
    reasons = tuple(
        reason or (None if finite else "the simulated tracks are not finite")
        for reason, finite in zip(observed.reasons, np.isfinite(kept).all(axis=1), strict=True)
    )
    failed = np.array([reason is not None for reason in reasons])
    squares = np.where(failed, np.inf, kept.sum(axis=1))
    mean = np.where(failed, np.inf, np.sqrt(kept).mean(axis=1))
    return Misfit(squares, mean, int(seen.sum()), reasons, difference if residuals else None)


@dataclass(frozen=True)
class Evaluation:
    """Misfits of B individuals to all R recordings of a problem."""

    per_recording: tuple[Misfit, ...]

    @property
    def fitness(self) -> Array:
        """[B] total of Eq. 14 over the recordings, m^2; inf for a failed individual."""
        total = np.zeros_like(self.per_recording[0].squares)
        for part in self.per_recording:
            total = total + part.squares
        return total

    @property
    def distance(self) -> Array:
        """[B] mean distance per marker and frame over all recordings, m."""
        total = np.zeros_like(self.per_recording[0].distance)
        for part in self.per_recording:
            total = total + part.distance * part.samples
        return np.asarray(total / sum(part.samples for part in self.per_recording))

    @property
    def reasons(self) -> tuple[str | None, ...]:
        """Per individual the first reason of failure, else None."""
        columns = zip(*(part.reasons for part in self.per_recording), strict=True)
        return tuple(next((r for r in column if r is not None), None) for column in columns)


def concatenate(parts: Sequence[Misfit]) -> Misfit:
    """Join misfits of consecutive individuals to the same recording."""
    residuals = [part.residuals for part in parts if part.residuals is not None]
    return Misfit(
        np.concatenate([part.squares for part in parts]),
        np.concatenate([part.distance for part in parts]),
        parts[0].samples,
        tuple(reason for part in parts for reason in part.reasons),
        np.concatenate(residuals) if residuals else None,
    )


def base_genome(model: Model, values: Mapping[str, float] | None = None) -> Genome:
    """The model's nominal genome with ``values`` changed."""
    return Genome.nominal(model.genes).replace(values or {})
