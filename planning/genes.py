"""How well genes will be known: predicted standard errors, and the beats from which they reach a target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.calibration.estimates.uncertainty import PRIOR, share_map, value_slopes
from wingfit.inference.design import Information
from wingfit.planning.outcome import PlannedGene
from wingfit.records import Gene, Genome
from wingfit.records.array_types import Array, Float

MOST_FACTOR = 1000.0  # times the planned beats, beyond which no number of beats is given


@dataclass(frozen=True, eq=False)
class GeneErrors:
    """Converts covariances of the ``genes`` scaled to 0..1 to standard errors at the values in ``genome``."""

    genes: Sequence[Gene]
    genome: Genome

    @property
    def values(self) -> Array:
        """Values [F]."""
        return np.array([self.genome[gene.name] for gene in self.genes])

    @property
    def prior(self) -> Array:
        """Information [F] of the prior of the genes, whose standard deviation is half the range."""
        return np.full(len(self.genes), PRIOR**-2)

    def absolute(self, unit: Float[Array, "F F"]) -> Float[Array, " F"]:
        """Return standard errors [F] in the units of the genes."""
        return np.asarray(np.sqrt(np.diag(unit)) * value_slopes(list(self.genes), self.values)[0])

    def relative(self, unit: Float[Array, "F F"]) -> Float[Array, " F"]:
        """Return relative standard errors [F]; of weights of a group, those of their shares of the sum."""
        genes = list(self.genes)
        to_shares = share_map(genes, self.genome) * value_slopes(genes, self.values)[1]
        return np.asarray(np.sqrt(np.diag(to_shares @ unit @ to_shares.T)))

    def of(self, said: Information) -> Float[Array, " F"]:
        """Return relative standard errors [F] of estimates from recordings that say ``said``."""
        return self.relative(said.covariance(self.prior))


def planned_genes(
    errors: GeneErrors, said: Sequence[Information], beats: float, target: float
) -> tuple[PlannedGene, ...]:
    """Return how well each gene will be known from recordings that say ``said``, of so many ``beats`` each.

    ``target``: relative standard error that counts as identified.
    """
    total = said[0].times(0.0)
    for one in said:
        total = total + one
    covariance = total.covariance(errors.prior)
    absolute, relative = errors.absolute(covariance), errors.relative(covariance)
    alone = np.min([errors.of(one) for one in said], axis=0)
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / scale / scale[:, None] - np.eye(len(scale))
    needed = beats_for(errors, total, beats, target)
    found = list[PlannedGene]()
    for k, gene in enumerate(errors.genes):
        other = int(np.argmax(np.abs(correlation[k])))
        found.append(
            PlannedGene(
                name=gene.name,
                unit=gene.unit,
                value=float(errors.values[k]),
                standard_error=float(absolute[k]),
                relative_percent=100.0 * float(relative[k]),
                identified=bool(relative[k] <= target),
                beats_for_target=needed[k],
                alone_percent=100.0 * float(alone[k]),
                correlated_with=errors.genes[other].name if len(scale) > 1 else None,
                correlation=float(correlation[k, other]),
            )
        )
    return tuple(found)


def beats_for(errors: GeneErrors, total: Information, beats: float, target: float) -> list[int | None]:
    """Return the number of beats of every recording from which the error of each gene is at most ``target``.

    None where MOST_FACTOR times the planned ``beats`` are not enough. ``total``: what the planned recordings say.
    """
    factors = np.geomspace(1.0 / max(beats, 1.0), MOST_FACTOR, 240)
    reached = np.array([errors.of(total.times(factor)) <= target for factor in factors])
    found = list[int | None]()
    for k in range(reached.shape[1]):
        first = np.flatnonzero(reached[:, k])
        found.append(int(np.ceil(factors[first[0]] * beats - 1e-9)) if len(first) else None)
    return found
