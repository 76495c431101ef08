"""What the data can tell about each gene: Cramer-Rao bounds at an estimate, correlations, and the same in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from calibration.beats import ENOUGH, FEWEST, beat_score_covariance, beat_scores, widening
from calibration.coloured import Block, score_covariance
from calibration.covariance import Noise, whitened_sensitivity
from calibration.evaluator import Evaluator
from calibration.linearised import Linearised, free_genes, linearise, unit_at
from calibration.problem import Problem
from calibration.remarks import remarks
from records import Gene, Genome

Array = npt.NDArray[np.float64]

IDENTIFIABLE = 0.075  # relative standard error: a 95 % interval within 15 %
PRIOR = 0.5  # standard deviation of the box as a prior, in unit coordinates: its half width
SMALL = 0.05  # of the box: what a value of a linear gene is at least compared with


@dataclass(frozen=True)
class Standing:
    """Relative standard error of a gene (of a share: when normalised), and whether it is at most IDENTIFIABLE."""

    standard_error: float
    identifiable: bool


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of an estimate.

    Attributes:
        free: names of the genes.
        values: [F], at which this was evaluated.
        covariance: [F, F] of the values, Cramer-Rao bounds for coloured residuals, the gene box being a weak prior.
        relative: [F, F] covariance of the values relative to themselves, shares normalised.
        told: [F], False for a gene whose neighbours cannot be simulated; its error is infinite.
        noise: R of each recording, [C, C], m^2 or N^2.
        cost: Eq. 22 at the values, with that R.
        remarks: what the data cannot tell, in words.
    """

    free: tuple[str, ...]
    values: Array
    covariance: Array
    relative: Array
    told: npt.NDArray[np.bool_]
    noise: tuple[Array, ...]
    cost: float
    remarks: tuple[str, ...]

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard error of each value, in the gene's unit."""
        errors = np.where(self.told, np.sqrt(np.diag(self.covariance)), np.inf)
        return dict(zip(self.free, errors.tolist(), strict=True))

    @property
    def correlation(self) -> Array:
        """[F, F]."""
        scale = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / scale / scale[:, None])

    @property
    def standing(self) -> dict[str, Standing]:
        """Standing of each gene."""
        errors = np.where(self.told, np.sqrt(np.diag(self.relative)), np.inf)
        return {n: Standing(float(e), bool(e <= IDENTIFIABLE)) for n, e in zip(self.free, errors, strict=True)}


def standing(problem: Problem, evaluator: Evaluator) -> dict[str, Standing]:
    """Standing of each free gene at the problem's base genome; infinite errors where that cannot be simulated.

    The phase of each recording of tracks is refitted at every displaced genome, so the uncertainty of the trigger is in
    the errors.
    """
    try:
        return uncertainty(problem, evaluator).standing
    except ValueError:
        return {name: Standing(np.inf, False) for name in problem.free}


def uncertainty(problem: Problem, evaluator: Evaluator) -> Uncertainty:
    """Uncertainty of the free genes at the problem's base genome; ValueError when that cannot be simulated."""
    genes = free_genes(problem)
    values = np.array([problem.base[gene.name] for gene in genes])
    linear = linearise(problem, evaluator, unit_at(genes, values))
    noise = [Noise.of(problem, r, v) for r, v in enumerate(linear.residuals)]
    unit = unit_covariance(problem, linear, noise)
    per_value, per_cent = _slopes(genes, values)
    to_shares = _share_map(genes, problem.base) * per_cent
    relative = to_shares @ unit @ to_shares.T
    return Uncertainty(
        free=problem.free,
        values=values,
        covariance=unit * per_value * per_value[:, None],
        relative=relative,
        told=linear.told,
        noise=tuple(n.covariance for n in noise),
        cost=float(sum(n.cost(v) for n, v in zip(noise, linear.residuals, strict=True))),
        remarks=remarks(genes, relative, linear.told, IDENTIFIABLE),
    )


def unit_covariance(problem: Problem, linear: Linearised, noise: list[Noise]) -> Array:
    """Covariance [F, F] of an estimate in unit coordinates.

    The box is a weak prior, without which nothing would bound a gene that the data ignore.
    """
    size = len(problem.free)
    information, blocks, by_beats = np.zeros((size, size)), [], np.zeros((size, size))
    fewest = np.inf  # beats, of all recordings; no number for tracks
    for record, n, residual, slope in zip(
        problem.recordings, noise, linear.residuals, linear.sensitivities, strict=True
    ):
        seen = np.isfinite(residual)
        kept = seen.any(axis=0)
        white, sensitivity = n.whitened(residual)[:, kept], whitened_sensitivity(n, slope)[:, kept]
        information += np.einsum("tcp,tcq->pq", sensitivity, sensitivity, optimize=True)
        grouped = record.kind == "forces"
        blocks.append(Block.of(record.times, white, sensitivity, seen[:, kept], grouped=grouped))
        scores, used = beat_scores(record, white, sensitivity) if grouped else (np.empty((0, size)), 1.0)
        fewest = min(fewest, len(scores))
        if len(scores) >= FEWEST:
            by_beats += beat_score_covariance(scores, used)
    prior = np.eye(size) / PRIOR**2
    bread = np.asarray(np.linalg.inv(information + prior), float)
    beats = np.asarray(bread @ (by_beats + prior) @ bread)
    if ENOUGH <= fewest < np.inf:
        return beats * widening(fewest)
    samples = np.asarray(bread @ (score_covariance(blocks, bread) + prior) @ bread)
    if not FEWEST <= fewest < np.inf:
        return samples
    # Few beats tell their own scatter badly: whichever error is larger, with the correlations of the samples.
    larger = np.sqrt(np.maximum(np.diag(beats) / np.diag(samples), 1.0))
    return samples * larger * larger[:, None]


def _slopes(genes: list[Gene], values: Array) -> tuple[Array, Array]:
    """Per unit coordinate: change of each value, and the same relative to the value."""
    width = np.array([np.log(g.upper / g.lower) if g.scale == "log" else g.upper - g.lower for g in genes])
    log = np.array([gene.scale == "log" for gene in genes])
    size = np.where(log, 1.0, np.maximum(np.abs(values), SMALL * width))
    return np.where(log, width * values, width), width / size


def _share_map(genes: list[Gene], base: Genome) -> Array:
    """From the logarithms of weights to those of the normalised shares, which are what people compare.

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
