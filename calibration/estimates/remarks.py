"""Remarks on genes that are not identifiable, from the covariance of an estimate."""

from __future__ import annotations

import numpy as np

from wingfit.records import Gene
from wingfit.records.array_types import Array, Mask

MEMBER = 0.3  # of the largest component of a direction: a gene with less does not belong to the direction
ALIKE = 0.25  # components that differ by less count as equal
HELPED = 0.5  # genes compensate each other if knowing the others reduces the error of each to less than this part
ROUND_OFF = 1e-9  # of the largest variance, so that a covariance can be inverted


def remarks(genes: list[Gene], relative: Array, known: Mask, largest: float) -> tuple[str, ...]:
    """Return remarks that name the genes whose relative standard error is larger than ``largest``.

    ``relative`` [F, F] is the covariance of relative changes of the genes. Its eigenvectors with large eigenvalues are
    directions in the space of genes along which the data hardly change: one gene that is not identifiable, or several
    that compensate each other. Weights of one group (``Gene.share_of``), which always compensate each other, are named
    together. ``known`` [F] is False for a gene without a known error.
    """
    found = [
        f"{gene.name} has no known error: no neighbour of the best genome can be simulated"
        for gene, ok in zip(genes, known, strict=True)
        if not ok
    ]
    single = [k for k, gene in enumerate(genes) if known[k] and gene.share_of is None]
    found += _directions([genes[k].name for k in single], relative[np.ix_(single, single)], largest)
    for group in dict.fromkeys(gene.share_of for gene in genes if gene.share_of):
        weak = [k for k, g in enumerate(genes) if g.share_of == group and known[k] and relative[k, k] > largest**2]
        if weak:
            found.append(f"these data do not identify the shares {group}: {_bounds(genes, relative, weak)}")
    return tuple(found)


def _bounds(genes: list[Gene], relative: Array, which: list[int]) -> str:
    return ", ".join(f"{genes[k].name} (standard error {np.sqrt(relative[k, k]):.0%})" for k in which)


def _directions(names: list[str], covariance: Array, largest: float) -> list[str]:
    """Return remarks on directions of genes along which the data hardly change, worst first; each gene is named once.

    ``covariance`` [F, F]: relative changes; a direction counts if its standard error is larger than ``largest``.
    """
    found: list[str] = []
    named: set[int] = set()
    sizes, directions = np.linalg.eigh(covariance)
    for size, direction in zip(sizes[::-1], directions.T[::-1], strict=True):
        members = [int(k) for k in np.flatnonzero(np.abs(direction) >= MEMBER * np.abs(direction).max())]
        if size > largest**2 and not named.issuperset(members):
            found += _direction(names, covariance, direction / np.abs(direction).max(), members, largest, named)
            named.update(members)
    return found


def _direction(
    names: list[str], covariance: Array, direction: Array, members: list[int], largest: float, named: set[int]
) -> list[str]:
    """Return remarks on one ``direction`` [F] (largest component 1): on single genes, or on how they compensate.

    ``members`` are the indices of the genes that belong to the direction, ``named`` those with an earlier remark.
    """
    errors = np.sqrt(np.diag(covariance))
    part = covariance[np.ix_(members, members)]
    part = part + ROUND_OFF * np.diag(part).max() * np.eye(len(members))
    alone = 1.0 / np.sqrt(np.diag(np.linalg.inv(part)))
    if len(members) == 1 or (alone > HELPED * errors[members]).any():
        weak = [k for k in members if errors[k] > largest and k not in named]
        return [f"{names[k]} is not identifiable from these data: its standard error is {errors[k]:.0%}" for k in weak]
    bounds = ", ".join(f"{names[k]} {errors[k]:.0%}" for k in members)
    if len(members) == 2 and np.abs(direction[members]).min() >= 1.0 - ALIKE:
        a, b = members
        sign = float(np.sign(direction[a] * direction[b]))
        together = np.sqrt(max(covariance[a, a] + covariance[b, b] - 2 * sign * covariance[a, b], 0.0))
        what = f"ratio {names[a]} : {names[b]}" if sign > 0 else f"product {names[a]} x {names[b]}"
        return [f"only the {what} is identifiable, to {together:.1%}; the standard errors of each are {bounds}"]
    listed = f"{', '.join(names[k] for k in members[:-1])} and {names[members[-1]]}"
    changes = ", ".join(f"{names[k]} {10 * direction[k]:+.0f} %" for k in members)
    return [
        f"{listed} compensate each other: {changes} hardly changes the data; the standard errors of each are {bounds}"
    ]
