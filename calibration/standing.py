"""What the data can tell about each gene: standard errors at the optimum, and whether they are small enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from calibration.evaluator import Evaluator
from calibration.problem import Problem
from records import Gene, Genome

Array = npt.NDArray[np.float64]

STEP = 0.02  # of the natural logarithm of a gene, for central differences
IDENTIFIABLE = 0.075  # relative standard error: a 95 % interval within 15 %


@dataclass(frozen=True)
class Standing:
    """Relative standard error of a gene and whether it is at most IDENTIFIABLE."""

    standard_error: float
    identifiable: bool


def standing(problem: Problem, evaluator: Evaluator) -> dict[str, Standing]:
    """Standing of each free gene at the problem's base genome.

    Least squares in the genes' logarithms; the covariance is the cluster-robust one (Liang and Zeger 1986) with one
    cluster per recorded channel, so that noise may be correlated in time and differ between channels. The gene box
    enters as a prior of its half width, without which a gene that the data ignore would have no finite error. The phase
    of each recording is refitted at every displaced genome, so the uncertainty of the trigger is in the errors. A gene
    whose neighbours cannot be simulated has an infinite error.
    """
    genes = [gene for gene in problem.model.genes if gene.name in problem.free]
    linear = _linearised(problem, genes, evaluator)
    if linear is None:
        return {gene.name: Standing(np.inf, False) for gene in genes}
    jacobian, residual, cluster, told = linear
    variance = float(residual @ residual / max(len(residual) - len(genes), 1))
    prior = np.diag([1.0 / (0.5 * np.log(gene.upper / gene.lower)) ** 2 for gene in genes])
    bread = np.linalg.inv(jacobian.T @ jacobian / variance + prior)
    scores = np.zeros((int(cluster.max()) + 1, len(genes)))
    np.add.at(scores, cluster, jacobian * residual[:, None] / variance)
    covariance = bread @ (scores.T @ scores + prior) @ bread
    shares = _share_map(genes, problem.base)
    errors = np.where(told, np.sqrt(np.diag(shares @ covariance @ shares.T)), np.inf)
    return {
        gene.name: Standing(float(error), bool(error <= IDENTIFIABLE))
        for gene, error in zip(genes, errors, strict=True)
    }


def _linearised(
    problem: Problem, genes: list[Gene], evaluator: Evaluator
) -> tuple[Array, Array, npt.NDArray[np.int64], npt.NDArray[np.bool_]] | None:
    """Jacobian [n, F] of the residuals by the genes' logarithms, residuals [n], channel of each [n], genes told [F].

    Steps that would leave the box are shortened to its edge; a neighbour that fails is replaced by the base, so that
    differences may become one-sided. None when the base itself fails.
    """
    n, base = len(genes), np.array([problem.base[gene.name] for gene in genes])
    lower, upper = np.array([g.lower for g in genes]), np.array([g.upper for g in genes])
    up = np.minimum(base[None] * np.exp(STEP * np.eye(n)), upper)
    down = np.maximum(base[None] * np.exp(-STEP * np.eye(n)), lower)
    evaluation = evaluator.evaluate(problem, np.vstack([base[None], up, down]), residuals=True)
    good = np.array([reason is None for reason in evaluation.reasons])
    if not good[0]:
        return None
    row = np.where(good, np.arange(2 * n + 1), 0)
    width = np.log(np.diag(up) / base) * good[1 : n + 1] + np.log(base / np.diag(down)) * good[n + 1 :]
    told = width > 0
    blocks, residuals, clusters, channels = [], [], [], 0
    for part in evaluation.per_recording:
        if part.residuals is None:
            raise TypeError("the evaluator returned no residuals although they were asked for")
        seen = np.isfinite(part.residuals[0])
        difference = part.residuals[row[1 : n + 1]] - part.residuals[row[n + 1 :]]
        blocks.append(difference[:, seen].T / np.where(told, width, 1.0))
        residuals.append(part.residuals[0][seen])
        clusters.append(channels + np.nonzero(seen)[1])
        channels += seen.shape[1]
    return np.vstack(blocks), np.concatenate(residuals), np.concatenate(clusters), told


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
