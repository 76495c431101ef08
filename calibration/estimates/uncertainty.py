"""How well each gene is identified: Cramer-Rao bounds at an estimate, correlations, and remarks."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from wingfit.records import Gene, Genome, Recording
from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread

IDENTIFIABLE = 0.075  # relative standard error: a 95 % interval within 15 %
PRIOR = 0.5  # standard deviation of the box as a prior, in unit coordinates: its half width
SMALL = 0.05  # of the box: what a value of a linear gene is at least compared with


@dataclass(frozen=True)
class Standing:
    """Relative standard error of a gene, and whether it is at most IDENTIFIABLE; of a share, after normalisation.

    ``absolute`` is the standard error in the gene's unit (of a share: of its weight).
    """

    standard_error: float
    identifiable: bool
    absolute: float


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of an estimate.

    Attributes:
        free: names of the genes.
        values: [F], at which this was evaluated.
        covariance: [F, F] of the values, Cramer-Rao bounds for coloured residuals, the gene box being a weak prior.
        relative: [F, F] covariance of the values relative to themselves, shares normalised.
        known: [F], False for a gene that a bound stopped, or whose neighbours cannot be simulated: its error is
            infinite, and those of the others are for its value as it is.
        noise: R of each recording, [C, C], m^2 or N^2.
        cost: Eq. 22 at the values, with that R.
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
        """Standard error of each value, in the gene's unit."""
        errors = np.where(self.known, np.sqrt(np.diag(self.covariance)), np.inf)
        return dict(zip(self.free, errors.tolist(), strict=True))

    @property
    def correlation(self) -> Array:
        """Correlation of the values, [F, F]."""
        scale = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / scale / scale[:, None])

    @property
    def standing(self) -> dict[str, Standing]:
        """Standard errors of each free gene, by name, and whether they identify it."""
        errors = np.where(self.known, np.sqrt(np.diag(self.relative)), np.inf)
        absolute = self.standard_errors
        return {
            n: Standing(float(e), bool(e <= IDENTIFIABLE), absolute[n]) for n, e in zip(self.free, errors, strict=True)
        }


@one_blas_thread
def standing(problem: Problem, evaluator: Evaluator) -> dict[str, Standing]:
    """Standard errors of each free gene at the problem's base genome; infinite where that cannot be simulated.

    The phase of each recording of tracks is refitted at every displaced genome, so the errors include the
    uncertainty of the trigger.
    """
    try:
        return uncertainty(problem, evaluator).standing
    except ValueError:
        return {name: Standing(np.inf, False, np.inf) for name in problem.free}


@one_blas_thread
def uncertainty(problem: Problem, evaluator: Evaluator) -> Uncertainty:
    """Uncertainty of the free genes at the problem's base genome; ValueError when that cannot be simulated."""
    genes = free_genes(problem)
    values = np.array([problem.base[gene.name] for gene in genes])
    linear = linearise(problem, evaluator, unit_at(genes, values))
    free = ~stopped(genes, values)
    linear = replace(linear, known=linear.known & free)
    noise = [Noise.of(record, v) for record, v in zip(problem.recordings, linear.residuals, strict=True)]
    unit, doubts = unit_covariance(problem, linear, noise)
    per_value, per_cent = _slopes(genes, values)
    to_shares = _share_map(genes, problem.base) * per_cent
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
    """Covariance [F, F] of an estimate in unit coordinates, and remarks on recordings with too few beats.

    The gene box is a weak prior; without it, the variance of a gene that no datum depends on would be infinite. A gene
    that is not ``known`` has the variance of this prior, and the errors of the others hold for its present value.
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
    covariance[np.ix_(known, known)] = bread @ (meat + prior) @ bread
    few = [p for p in parts if p.record.kind == "forces" and len(p.scores) < FEWEST]
    return covariance, tuple(
        f"recording {part.record.name!r} has {len(part.scores)} whole beats, and fewer than {FEWEST} say little "
        "about how much beats differ: standard errors may be too small"
        for part in few
    )


@dataclass(frozen=True)
class _Part:
    """One recording, whitened: residuals [T, C], sensitivities [T, C, F], and the score of each whole beat [B, F].

    A score is the derivative of the log-likelihood with respect to the F genes.
    """

    record: Recording
    white: Array
    sensitivity: Array
    seen: Mask
    scores: Array
    used: float

    @classmethod
    def of(cls, record: Recording, noise: Noise, residual: Array, slope: Array) -> _Part:
        seen = np.isfinite(residual)
        kept = seen.any(axis=0)
        white, sensitivity = noise.whitened(residual)[:, kept], whitened_sensitivity(noise, slope)[:, kept]
        scores, used = np.empty((0, slope.shape[2])), 1.0
        if record.kind == "forces":
            scores, used = beat_scores(record, white, sensitivity, seen)
        return cls(record, white, sensitivity, seen[:, kept], scores, used)

    @property
    def information(self) -> Array:
        return np.asarray(np.einsum("tcp,tcq->pq", self.sensitivity, self.sensitivity, optimize=True))

    def from_beat_to_beat(self, bread: Array) -> Array:
        """Covariance [F, F] of the sum of scores, estimated from their scatter between beats."""
        absorbed = float(np.trace(bread @ self.information)) / len(bread)
        return beat_score_covariance(self.scores, self.used, absorbed)

    def block(self) -> Block:
        """The residuals and sensitivities from which the correlation between samples is estimated."""
        white, forces = self.white, self.record.kind == "forces"
        if forces:
            white = without_mean_beat(self.record, white, len(self.scores))
        return Block.of(self.record.times, white, self.sensitivity, self.seen, grouped=forces)


def _from_samples(parts: list[_Part], bread: Array) -> Array:
    """Covariance [F, F] of the sum of all scores, from the correlations between samples.

    Where the scores of whole beats, few as they are, scatter more than that, their scatter is used.
    """
    total = np.zeros_like(bread)
    for part, meat in zip(parts, score_covariances([part.block() for part in parts], bread), strict=True):
        larger = np.ones(len(bread))
        if len(part.scores) >= FEWEST:
            beats = np.diag(part.from_beat_to_beat(bread))
            larger = np.sqrt(np.maximum(beats / np.maximum(np.diag(meat), 1e-300), 1.0))
        total += meat * larger * larger[:, None]
    return total


def _slopes(genes: list[Gene], values: Array) -> tuple[Array, Array]:
    """Derivatives [F] of the values by their unit coordinates, and the same derivatives relative to the values."""
    width = np.array([np.log(g.upper / g.lower) if g.scale == "log" else g.upper - g.lower for g in genes])
    log = np.array([gene.scale == "log" for gene in genes])
    size = np.where(log, 1.0, np.maximum(np.abs(values), SMALL * width))
    return np.where(log, width * values, width), width / size


def _share_map(genes: list[Gene], base: Genome) -> Array:
    """Matrix [F, F] from relative changes of the weights to relative changes of the normalised shares.

    The sum of a group runs over all its weights, also those that are not searched.
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
