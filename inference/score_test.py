"""Score tests: how much of a residual an addition to a model would explain if all nuisance genes were refitted.

Nuisance genes are the other genes that are estimated at the same time. The changes of the residual that they can cause
are projected out of the residual and of the changes that the addition causes (Rao 1948). The latter are changes of
finite size here, because the derivative of many effects is zero where they are switched off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float

DEPENDENT = 1e-10  # singular values of the nuisance sensitivities below this part of the largest are round-off
RIDGE = 1e-9  # added to the Gram matrix, relative to its diagonal: regular even if fields are almost parallel
INVISIBLE = 1e-12  # part of a field that remains after projection, relative to its norm: less is round-off


@dataclass(frozen=True)
class Nuisance:
    """Changes of N whitened residuals that the nuisance genes can cause: an orthonormal ``basis`` [N, O] of them."""

    basis: Float[Array, "N O"]

    @classmethod
    def of(cls, slopes: Float[Array, "N F"]) -> Nuisance:
        """Compute the basis for F nuisance genes from ``slopes`` [N, F], the sensitivities of whitened residuals."""
        basis, power, _ = np.linalg.svd(slopes, full_matrices=False)
        return cls(basis[:, power > DEPENDENT * power.max(initial=0.0)])

    def rest(self, vectors: Float[Array, "*batch M"]) -> Float[Array, "*batch N"]:
        """Subtract from ``vectors`` [..., M] their projection on the basis; return the difference [..., N].

        M may be smaller than N: missing entries at the end count as zero.
        """
        size = vectors.shape[-1]
        inside = (vectors @ self.basis[:size]) @ self.basis.T
        inside[..., :size] -= vectors
        return np.asarray(-inside)


def explained(fields: Float[Array, "S N"], residual: Float[Array, " N"]) -> float:
    """Decrease of the sum of squares of ``residual`` [N] when S multiples of ``fields`` [S, N] are fitted to it.

    Each of the S fields is a change of the residual that an addition to the model causes.
    """
    inner, score = fields @ fields.T, fields @ residual
    return float(score @ np.linalg.solve(inner + RIDGE * np.trace(inner) * np.eye(len(inner)) + 1e-300, score))


def amounts(
    fields: Float[Array, "S N"],
    residual: Float[Array, " N"],
    limits: tuple[Float[Array, " S"], Float[Array, " S"]],
    smallest: float,
) -> Float[Array, " S"]:
    """Multiples [S] of ``fields`` [S, N] whose sum with ``residual`` [N] has the least sum of squares, within limits.

    Each field is a change of the residual that an addition to the model causes. ``limits``: smallest and largest
    multiple of each field, [S] each, with 0 between them. A single multiple is clipped to its limits; several are
    reduced by a common factor, which preserves their ratios. A field whose norm is at most ``smallest`` gets the
    multiple zero.
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
    """Sum of squares of ``residual`` [N] plus ``multiples`` [S] times ``fields`` [S, N]."""
    return float(np.sum((residual + multiples @ fields) ** 2))


def spread(count: int, size: int) -> Float[Array, "count size"]:
    """Return ``count`` points [count, size] of a Halton sequence, evenly distributed over [0, 1]^size."""
    points = scipy.stats.qmc.Halton(size, scramble=False).random(count + 1)
    return np.asarray(points[1:])  # the first of all is a corner
