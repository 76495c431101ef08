"""Estimates how uncertain each gene is: Cramer-Rao bounds at an estimate, correlations, and remarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wingfit.calibration.estimates.linearised import Linearised, free_genes, linearise, stopped, unit_at
from wingfit.calibration.estimates.remarks import remarks
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem
from wingfit.inference.noise.between_beats import (
    ENOUGH,
    FEWEST,
    beat_score_covariance,
    beat_scores,
    widening,
    without_mean_beat,
)
from wingfit.inference.noise.coloured import Block, score_covariances
from wingfit.inference.noise.white import Noise, whitened_sensitivity
from wingfit.records import AnyRecording, Gene, Genome, Recording
from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread

IDENTIFIABLE = 0.075  # relative standard error: a 95 % interval within 15 %
PRIOR = 0.5  # standard deviation of the prior, genes scaled to 0..1: half the range between the bounds
SMALL = 0.05  # of the range: errors of linear genes with smaller values are relative to this


@dataclass(frozen=True)
class Standing:
    """Relative standard error of a gene, and whether it is at most IDENTIFIABLE.

    For a gene that is a weight of a group (``Gene.share_of``), the relative error is that of weight / sum of weights.
    ``absolute`` is the standard error in the gene's unit (of a weight: of the weight itself).
    """

    standard_error: float
    identifiable: bool
    absolute: float


@dataclass(frozen=True)
class GeneCovariance:
    """Covariance [F][F] of the estimates of F genes called ``names``; an entry has the product of both units."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    @classmethod
    def of_independent(cls, parts: Sequence[GeneCovariance]) -> GeneCovariance | None:
        """Return the covariance of all genes of ``parts``, which were estimated from different data; None if none."""
        names = tuple(name for part in parts for name in part.names)
        if not names:
            return None
        whole, start = np.zeros((len(names), len(names))), 0
        for part in parts:
            own = slice(start, start + len(part.names))
            whole[own, own], start = part.matrix, own.stop
        return cls(names, tuple(tuple(row) for row in whole.tolist()))


@dataclass(frozen=True)
class Correlations:
    """Correlation coefficients [F, F] of the estimated values of ``genes``; NaN for a gene whose error is not known.

    Of a weight of a group (``Gene.share_of``) they are those of weight / sum of weights.
    """

    genes: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]


class GeneErrors(NamedTuple):
    """Standard errors of the free genes by name, and what is known together; None if the genome cannot be simulated.

    ``correlations`` are those of values and shares, ``covariance`` is that of the genes themselves.
    """

    standing: dict[str, Standing]
    correlations: Correlations | None = None
    covariance: GeneCovariance | None = None


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of an estimate.

    Attributes:
        free: names of the F free genes.
        values: [F], estimates at which the covariance was computed.
        covariance: [F, F] of the values, Cramer-Rao bounds for coloured residuals; the range between the bounds of a
            gene is a weak prior.
        relative: [F, F] covariance of relative changes of the values; weights of a group divided by their sum.
        known: [F], False for a gene at a bound, or whose displaced genomes cannot be simulated: its error is infinite,
            and the errors of the other genes hold for its present value.
        noise: estimated noise covariance R of each recording, [C, C], m^2 or N^2.
        cost: J of Armanini et al. 2016, Eq. 22, at the values, with this R.
        remarks: which genes are not identifiable, and why.
    """

    free: tuple[str, ...]
    values: Array
    covariance: Array
    relative: Array
    known: Mask
    noise: tuple[Array, ...]
    cost: float
    remarks: tuple[str, ...]

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard error of each gene, by name, in its unit; infinite where not ``known``."""
        errors = np.where(self.known, np.sqrt(np.diag(self.covariance)), np.inf)
        return dict(zip(self.free, errors.tolist(), strict=True))

    @property
    def correlation(self) -> Array:
        """Correlation coefficients [F, F] of the estimated values."""
        scale = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / scale / scale[:, None])

    @property
    def of_known(self) -> GeneCovariance:
        """The covariance without the genes that are not ``known``."""
        (known,) = np.nonzero(self.known)
        part = self.covariance[np.ix_(known, known)]
        return GeneCovariance(tuple(self.free[k] for k in known), tuple(tuple(row) for row in part.tolist()))

    @property
    def correlations(self) -> Correlations:
        """Correlations of the values, of weights of a group those of their shares."""
        scale = np.where(self.known, np.sqrt(np.diag(self.relative)), np.nan)
        scale[scale == 0.0] = np.nan
        values = self.relative / scale / scale[:, None]
        return Correlations(self.free, tuple(tuple(row) for row in values.tolist()))

    @property
    def standing(self) -> dict[str, Standing]:
        """Standard errors of each free gene, by name, and whether the gene is identifiable."""
        errors = np.where(self.known, np.sqrt(np.diag(self.relative)), np.inf)
        absolute = self.standard_errors
        return {
            n: Standing(float(e), bool(e <= IDENTIFIABLE), absolute[n]) for n, e in zip(self.free, errors, strict=True)
        }


@one_blas_thread
def gene_errors(problem: Problem, evaluator: Evaluator) -> GeneErrors:
    """Return the errors of the free genes at the base genome; infinite, and no correlations, if it cannot be simulated.

    For every displaced genome, the start of the simulated beat is aligned anew with each recording of tracks, so the
    errors include the uncertainty of this start.
    """
    try:
        found = uncertainty(problem, evaluator)
    except ValueError:
        return GeneErrors({name: Standing(np.inf, False, np.inf) for name in problem.free})
    return GeneErrors(found.standing, found.correlations, found.of_known)


@one_blas_thread
def uncertainty(problem: Problem, evaluator: Evaluator) -> Uncertainty:
    """Return the uncertainty of the free genes at the base genome; ValueError if this genome cannot be simulated."""
    genes = free_genes(problem)
    values = np.array([problem.base[gene.name] for gene in genes])
    linear = linearise(problem, evaluator, unit_at(genes, values))
    free = ~stopped(genes, values)
    linear = replace(linear, known=linear.known & free)
    noise = Noise.of_each(problem.recordings, linear.residuals)
    unit, doubts = unit_covariance(problem, linear, noise)
    per_value, per_cent = value_slopes(genes, values)
    to_shares = share_map(genes, problem.base) * per_cent
    relative = to_shares @ unit @ to_shares.T
    (inside,) = np.nonzero(free)
    own = remarks([genes[k] for k in inside], relative[np.ix_(inside, inside)], linear.known[inside], IDENTIFIABLE)
    return Uncertainty(
        free=problem.free,
        values=values,
        covariance=unit * per_value * per_value[:, None],
        relative=relative,
        known=linear.known,
        noise=tuple(n.covariance for n in noise),
        cost=float(sum(n.cost(v) for n, v in zip(noise, linear.residuals, strict=True))),
        remarks=(*doubts, *own),
    )


def unit_covariance(problem: Problem, linear: Linearised, noise: list[Noise]) -> tuple[Array, tuple[str, ...]]:
    """Return the covariance [F, F] of an estimate, genes scaled to 0..1, and remarks on recordings with too few beats.

    ``linear``: the problem linearised at the estimate; ``noise``: R of each recording. The range between the bounds of
    a gene is a weak prior; without it, the variance of a gene that has no influence on the data would be infinite. A
    gene that is not ``known`` has the variance of this prior, and errors of other genes hold for its present value.
    """
    known = np.flatnonzero(linear.known)
    covariance = np.eye(len(problem.free)) * PRIOR**2
    if not len(known):
        return covariance, ()
    records = problem.recordings
    parts = [
        _Part.of(record, n, residual, slope[:, :, known])
        for record, n, residual, slope in zip(records, noise, linear.residuals, linear.sensitivities, strict=True)
    ]
    prior = np.eye(len(known)) / PRIOR**2
    bread = np.asarray(np.linalg.inv(sum(part.information for part in parts) + prior), float)
    beats = sum(len(part.scores) for part in parts)
    if beats >= ENOUGH and all(len(part.scores) >= FEWEST for part in parts):
        meat = sum(part.from_beat_to_beat(bread) for part in parts) * widening(beats)
    else:
        meat = _from_samples(parts, bread)
    found = bread @ (meat + prior) @ bread
    if any(record.kind == "series" for record in records):
        samples = sum(int(part.seen.sum()) for part in parts)
        if samples <= len(known):
            return covariance, (
                f"{samples} samples do not determine {len(known)} genes: no standard error is known; record more, or "
                "fix some genes",
            )
        found = _as_large(found, bread) * (samples / (samples - len(known)))
    covariance[np.ix_(known, known)] = found
    few = [p for p in parts if p.record.kind == "forces" and len(p.scores) < FEWEST]
    return covariance, tuple(
        f"recording {part.record.name!r} has {len(part.scores)} whole beats, and fewer than {FEWEST} say little "
        "about how much beats differ: standard errors may be too small"
        for part in few
    )


def _as_large(covariance: Array, least: Array) -> Array:
    """Return ``covariance`` [F, F] with every variance at least that in ``least`` [F, F]; correlations stay.

    The residuals of a recording with hardly more samples than genes of its own are small and say nothing about noise.
    """
    factor = np.sqrt(np.maximum(np.diag(least) / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return np.asarray(covariance * factor * factor[:, None])


@dataclass(frozen=True)
class _Part:
    """One recording, whitened: residuals ``white`` [T, C], their ``sensitivity`` [T, C, F] to the F genes, scores.

    ``scores`` [B, F], for each of B whole beats of forces, are derivatives of the log-likelihood with respect to the
    genes; ``used`` is the fraction of the samples in these beats. ``seen`` [T, C] is True where values were compared.
    """

    record: AnyRecording
    white: Array
    sensitivity: Array
    seen: Mask
    scores: Array
    used: float

    @classmethod
    def of(cls, record: AnyRecording, noise: Noise, residual: Array, slope: Array) -> _Part:
        seen = np.isfinite(residual)
        kept = seen.any(axis=0)
        white, sensitivity = noise.whitened(residual)[:, kept], whitened_sensitivity(noise, slope)[:, kept]
        scores, used = np.empty((0, slope.shape[2])), 1.0
        if isinstance(record, Recording) and record.kind == "forces":
            scores, used = beat_scores(record, white, sensitivity, seen)
        return cls(record, white, sensitivity, seen[:, kept], scores, used)

    @property
    def information(self) -> Array:
        return np.asarray(np.einsum("tcp,tcq->pq", self.sensitivity, self.sensitivity, optimize=True))

    def from_beat_to_beat(self, bread: Array) -> Array:
        """Return the covariance [F, F] of the sum of the scores, estimated from their scatter between beats.

        ``bread`` [F, F] is the covariance of the estimate if residuals were white.
        """
        absorbed = float(np.trace(bread @ self.information)) / len(bread)
        return beat_score_covariance(self.scores, self.used, absorbed)

    def blocks(self) -> list[Block]:
        """Return residuals and sensitivities on a regular grid of times, to estimate correlations between samples.

        Channels of a series have different noise, so that each has a block of its own.
        """
        white, record = self.white, self.record
        if record.kind == "series":
            own = (slice(k, k + 1) for k in range(white.shape[1]))
            return [
                Block.of(record.times, white[:, k], self.sensitivity[:, k], self.seen[:, k], grouped=False) for k in own
            ]
        forces = isinstance(record, Recording) and record.kind == "forces"
        if isinstance(record, Recording) and forces:
            white = without_mean_beat(record, white, len(self.scores))
        return [Block.of(record.times, white, self.sensitivity, self.seen, grouped=forces)]


def _from_samples(parts: list[_Part], bread: Array) -> Array:
    """Return the covariance [F, F] of the sum of all scores, from the correlations between samples of the residuals.

    If the scores of the whole beats of a recording scatter more than this covariance predicts, it is scaled up to their
    scatter. ``bread`` [F, F] is the covariance of the estimate if residuals were white.
    """
    total = np.zeros_like(bread)
    blocks = [(part, block) for part in parts for block in part.blocks()]
    for (part, _), meat in zip(blocks, score_covariances([block for _, block in blocks], bread), strict=True):
        larger = np.ones(len(bread))
        if len(part.scores) >= FEWEST:
            beats = np.diag(part.from_beat_to_beat(bread))
            larger = np.sqrt(np.maximum(beats / np.maximum(np.diag(meat), 1e-300), 1.0))
        total += meat * larger * larger[:, None]
    return total


def value_slopes(genes: list[Gene], values: Array) -> tuple[Array, Array]:
    """Return the derivatives [F] of the ``values`` [F] by the genes scaled to 0..1, and these divided by the values.

    The value of a linear gene counts as at least SMALL of its range in this division.
    """
    width = np.array([np.log(g.upper / g.lower) if g.scale == "log" else g.upper - g.lower for g in genes])
    log = np.array([gene.scale == "log" for gene in genes])
    size = np.where(log, 1.0, np.maximum(np.abs(values), SMALL * width))
    return np.where(log, width * values, width), width / size


def share_map(genes: list[Gene], base: Genome) -> Array:
    """Return the matrix [F, F] that converts relative changes of genes to those of the values that the model uses.

    Of weights of a group (``Gene.share_of``) the model uses weight / sum of weights, also of those not searched; other
    genes are unchanged.
    """
    out = np.eye(len(genes))
    for k, gene in enumerate(genes):
        if gene.share_of is None:
            continue
        total = sum(base[other.name] for other in base.genes if other.share_of == gene.share_of)
        for j, other in enumerate(genes):
            if other.share_of == gene.share_of:
                out[k, j] -= base[other.name] / total
    return out
