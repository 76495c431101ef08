"""Score tests: how much of a residual an addition to a model would explain, all nuisance genes being refitted.

The changes that the nuisance genes can make are projected out of the residual and of the changes by the addition (Rao
1948; here with changes of finite size, because many effects have no slope where they are switched off).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float

DEPENDENT = 1e-10  # of the largest direction of the nuisance genes; the rest is round-off
RIDGE = 1e-9  # of the fields' own squares, so that fields that are alike can be solved for
INVISIBLE = 1e-12  # of a field's length that the nuisance genes cannot make up for: less is round-off


@dataclass(frozen=True)
class Nuisance:
    """The changes of whitened residuals [N] that the nuisance genes can make: their orthonormal basis [N, O]."""

    basis: Float[Array, "N O"]

    @classmethod
    def of(cls, slopes: Float[Array, "N F"]) -> Nuisance:
        """The nuisance of F genes with the whitened sensitivities ``slopes`` [N, F]."""
        basis, power, _ = np.linalg.svd(slopes, full_matrices=False)
        return cls(basis[:, power > DEPENDENT * power.max(initial=0.0)])

    def rest(self, vectors: Float[Array, "*batch M"]) -> Float[Array, "*batch N"]:
        """``vectors`` [..., M] minus their projection on the basis, [..., N]; entries from M <= N on count as zero."""
        size = vectors.shape[-1]
        inside = (vectors @ self.basis[:size]) @ self.basis.T
        inside[..., :size] -= vectors
        return np.asarray(-inside)


def explained(fields: Float[Array, "S N"], residual: Float[Array, " N"]) -> float:
    """Decrease of the sum of squares of ``residual`` [N] when multiples of the ``fields`` [S, N] are fitted to it."""
    inner, score = fields @ fields.T, fields @ residual
    return float(score @ np.linalg.solve(inner + RIDGE * np.trace(inner) * np.eye(len(inner)) + 1e-300, score))


def amounts(
    fields: Float[Array, "S N"],
    residual: Float[Array, " N"],
    limits: tuple[Float[Array, " S"], Float[Array, " S"]],
    smallest: float,
) -> Float[Array, " S"]:
    """Multiples [S] of the ``fields`` [S, N] that bring ``residual`` [N] nearest to zero within ``limits``, [S] each.

    A single field is clipped; several are scaled together, so that their proportion stays. A field not longer than
    ``smallest`` gets zero.
    """
    length = np.linalg.norm(fields, axis=1)
    visible, found = length > smallest, np.zeros(len(fields))
    if not visible.any():
        return found
    part, low, high = fields[visible], limits[0][visible], limits[1][visible]
    best = -np.linalg.solve(part @ part.T + RIDGE * np.diag(length[visible] ** 2), part @ residual)
    if len(best) == 1:
        best = np.clip(best, low, high)
    else:
        above = np.where(best > 0, high / np.maximum(best, 1e-300), 1.0)
        below = np.where(best < 0, low / np.minimum(best, -1e-300), 1.0)
        best = best * min(1.0, float(above.min()), float(below.min()))
    found[visible] = best
    return found


def remaining(fields: Float[Array, "S N"], residual: Float[Array, " N"], multiples: Float[Array, " S"]) -> float:
    """Sum of squares of ``residual`` [N] plus ``multiples`` [S] of the ``fields`` [S, N]."""
    return float(np.sum((residual + multiples @ fields) ** 2))


def spread(count: int, size: int) -> Float[Array, "count size"]:
    """``count`` points [count, size] spread evenly over the unit box."""
    points = scipy.stats.qmc.Halton(size, scramble=False).random(count + 1)
    return np.asarray(points[1:])  # the first of all is a corner
