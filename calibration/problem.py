"""Defines the misfit of a genome, and a Problem: a model, recordings, and the genes that are searched."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wingfit.records import AnyRecording, Genome, Recording, Series
from wingfit.records.array_types import Array, ArrayLike, Mask
from wingfit.records.dataset import AnyKind
from wingfit.sim.model import Model

DEFAULT_AXES = ("x",)  # Armanini et al. 2016 fit the X force only


@dataclass(frozen=True)
class Problem:
    """All that is needed to compute misfits from values of the free genes. Picklable; sent to workers once.

    ``free`` are the genes searched, in the order of the columns of a batch; all others have their value in ``base``.
    ``axes`` are the force axes that are fitted, by default DEFAULT_AXES; of tracks, all coordinates are fitted.
    """

    model: Model
    recordings: tuple[AnyRecording, ...]
    free: tuple[str, ...]
    base: Genome
    axes: tuple[str, ...] = ()

    @cached_property
    def key(self) -> str:
        """Hash of the contents, under which workers cache the problem."""
        return hashlib.sha256(
            pickle.dumps((self.model, self.recordings, self.free, self.base, self.axes), 5)
        ).hexdigest()

    def genomes(self, values: ArrayLike) -> Array:
        """Return genomes [B, G] with all G genes of the model, from ``values`` [B, F] of the free genes."""
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
        squares: [B] sum of squares, inf for a failed individual. Of tracks: squared distance over frames and markers,
            m^2 (van der Grinten's thesis, Eq. 14); of forces: squared difference over instants and fitted axes,
            N^2; of a series: squared difference over samples and channels, relative to the range of the channel.
        distance: [B] mean distance per marker and frame, m; of forces the RMS difference, N, of a series relative to
            the ranges; inf for a failed one.
        samples: number of (frame, marker) pairs, or of (instant, axis) pairs, compared.
        reasons: [B] why an individual failed, None if it did not.
        residuals: [B, T, C] simulated minus recorded, m or N, NaN where not recorded or not fitted; None unless
            requested.
        kind: "tracks", "forces" or "series", which were compared.
    """

    squares: Array
    distance: Array
    samples: int
    reasons: tuple[str | None, ...]
    residuals: Array | None = None
    kind: AnyKind = "tracks"

    def taken(self, places: Sequence[int]) -> Misfit:
        """Return the misfits of the individuals at ``places``, which may be repeated."""
        at = np.asarray(places, int)
        return replace(
            self,
            squares=self.squares[at],
            distance=self.distance[at],
            reasons=tuple(self.reasons[place] for place in places),
            residuals=None if self.residuals is None else self.residuals[at],
        )


def misfit(problem: Problem, values: ArrayLike, recording: int, *, residuals: bool = False) -> Misfit:
    """Simulate B individuals, ``values`` [B, F] of the free genes, and compare with recording no. ``recording``."""
    record = problem.recordings[recording]
    observed = problem.model.observe(problem.genomes(values), record)
    difference = observed.channels - record.values
    if isinstance(record, Series):
        kept: Array = (difference[:, record.valid] / spans(record)[np.nonzero(record.valid)[1]]) ** 2
        not_finite = "the simulated channels are not finite"
    elif record.kind == "forces":
        fitted = compared(record, problem.axes)
        difference[:, ~fitted] = np.nan
        kept = difference[:, fitted] ** 2
        not_finite = "the modelled forces are not finite"
    else:
        seen = np.isfinite(record.positions).all(axis=2).ravel()
        kept = (difference.reshape(len(difference), -1, 3) ** 2).sum(axis=2)[:, seen]
        not_finite = "the simulated tracks are not finite"
    finite = [bool(np.isfinite(one).all()) for one in kept]
    reasons = tuple(
        reason or (None if fine else not_finite) for reason, fine in zip(observed.reasons, finite, strict=True)
    )
    failed = np.array([reason is not None for reason in reasons])
    # One row after the other: the order in which numpy sums along an axis depends on the number of rows.
    squares = np.where(failed, np.inf, [one.sum() for one in kept])
    tracks = record.kind == "tracks"
    distance = np.where(failed, np.inf, [np.sqrt(one).mean() if tracks else np.sqrt(one.mean()) for one in kept])
    return Misfit(squares, distance, kept.shape[1], reasons, difference if residuals else None, record.kind)


def spans(recording: Series) -> Array:
    """Return the range [C] of the recorded values of each channel, in its unit; 1 for a channel that never changes."""
    values, seen = recording.values, recording.valid
    most, least = np.where(seen, values, -np.inf).max(axis=0), np.where(seen, values, np.inf).min(axis=0)
    return np.where(most > least, most - least, 1.0)


def compared(recording: Recording, axes: tuple[str, ...] = ()) -> Mask:
    """Return True [T, C] for the values of forces that are fitted: those of ``axes``, at instants with all of them.

    No ``axes``: DEFAULT_AXES. ValueError for an axis that was not recorded.
    """
    axes = axes or DEFAULT_AXES
    for axis in axes:
        if axis not in recording.forces:
            raise ValueError(
                f"force axis {axis!r} is to be fitted, but recording {recording.name!r} has "
                f"{', '.join(recording.forces)}; fit those, or leave the recording out"
            )
    fitted = np.array([axis in axes for axis in recording.forces])
    whole = np.all(recording.valid[:, fitted], axis=1, keepdims=True)
    return np.asarray(whole & fitted)


@dataclass(frozen=True)
class Evaluation:
    """Misfits of B individuals to all recordings of a problem, one Misfit for each recording."""

    per_recording: tuple[Misfit, ...]

    def taken(self, places: Sequence[int]) -> Evaluation:
        """Return the evaluation of the individuals at ``places``, which may be repeated."""
        return Evaluation(tuple(part.taken(places) for part in self.per_recording))

    @property
    def fitness(self) -> Array:
        """Sum of squares of each individual [B] over all recordings, m^2 or N^2; inf for a failed individual."""
        total = np.zeros_like(self.per_recording[0].squares)
        for part in self.per_recording:
            total = total + part.squares
        return total

    @property
    def distance(self) -> Array:
        """Misfit of each individual [B] over all recordings: mean distance per marker and frame, m; forces: RMS, N."""
        total = np.zeros_like(self.per_recording[0].distance)
        for part in self.per_recording:
            total = total + (part.distance * part.samples if part.kind == "tracks" else part.squares)
        mean = total / sum(part.samples for part in self.per_recording)
        return np.asarray(mean if self.per_recording[0].kind == "tracks" else np.sqrt(mean))

    @property
    def reasons(self) -> tuple[str | None, ...]:
        """Why each individual [B] failed, the first reason; None if it did not fail."""
        columns = zip(*(part.reasons for part in self.per_recording), strict=True)
        return tuple(next((r for r in column if r is not None), None) for column in columns)


def concatenate(parts: Sequence[Misfit]) -> Misfit:
    """Join the misfits of consecutive groups of individuals to one recording."""
    residuals = [part.residuals for part in parts if part.residuals is not None]
    return Misfit(
        np.concatenate([part.squares for part in parts]),
        np.concatenate([part.distance for part in parts]),
        parts[0].samples,
        tuple(reason for part in parts for reason in part.reasons),
        np.concatenate(residuals) if residuals else None,
        parts[0].kind,
    )


def base_genome(model: Model, values: Mapping[str, float] | None = None) -> Genome:
    """Return the model's nominal genome with the genes in ``values`` (by name) changed."""
    return Genome.nominal(model.genes).replace(values or {})
