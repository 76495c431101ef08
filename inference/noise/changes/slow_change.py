"""What a change between the beats of a recording is compared with: parts of its noise, and how many sources it has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float

CERTAIN = 1e-5  # probability of noise alone below which a change counts as found
_RANK = 1e-6


@dataclass(frozen=True)
class Change:
    """A change between beats: ``ratio`` of its power to that of the noise near it.

    ``probability``: of such a ratio for noise alone, with a margin for noise that rises towards the change. ``size``:
    root mean square of the change beyond the noise, over all samples and channels, m or N. ``certain``: the change
    counts as found if the probability is smaller.
    """

    ratio: float
    probability: float
    size: float
    certain: float = CERTAIN

    @property
    def found(self) -> bool:
        """Whether noise alone does not explain the change."""
        return self.probability < self.certain


def independent_sources(near: Float[Array, "L C"], lines: float) -> float:
    """Number of independent sources of noise in C channels, of equal power: at most C.

    It is smaller where channels scatter together, or where some have most of the noise. ``near`` [L, C]: coefficients
    of the noise; ``lines``: how many of the L are independent. By chance, channels correlate that are independent; the
    mean of that is subtracted.
    """
    total = float((near**2).sum())
    small = near @ near.T if len(near) < near.shape[1] else near.T @ near
    square = (float((small**2).sum()) - total**2 / lines) / max(1.0 - 1.0 / lines, 0.5)
    return total**2 / max(square, total**2 / near.shape[1], 1e-300) or 1.0


def orthonormal(columns: Float[Array, "T P"], *others: Float[Array, "T _"]) -> Float[Array, "T P"]:
    """Return the nearest orthonormal columns to the part of ``columns`` [T, P] that is orthogonal to the ``others``.

    Where the columns depend on each other, so do those returned; :func:`rank` is the number of independent ones.
    """
    for other in others:
        columns = columns - other @ (other.T @ columns)
    basis, sizes, turned = np.linalg.svd(columns, full_matrices=False)
    kept = sizes > _RANK * sizes.max(initial=0.0)
    return np.asarray(basis[:, kept] @ turned[kept])


def rank(basis: Float[Array, "T P"]) -> float:
    """Return the number of independent columns of an :func:`orthonormal` basis [T, P]."""
    return float(np.round((basis**2).sum()))
