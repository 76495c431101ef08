"""What a slow change of a recording is compared with: parts of its noise, and how many sources that noise has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float

CERTAIN = 1e-5  # probability of noise alone below which a change counts as found
_RANK = 1e-6


@dataclass(frozen=True)
class Change:
    """A slow change: ``ratio`` of its power to that of the noise near it.

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


def independent_sources(near: Float[Array, "K L C"], lines: Float[Array, " K"]) -> float:
    """Number of independent sources of noise near K harmonics in C channels, of equal power: at most K C.

    It is smaller where channels scatter together, or where some harmonics or channels have most of the noise.
    ``near`` [K, L, C]: coefficients of the noise; ``lines`` [K]: how many of the L are independent. By chance, channels
    correlate that are independent; the mean of that is subtracted.
    """
    total = (near**2).sum(axis=(1, 2))
    square = ((near.transpose(0, 2, 1) @ near) ** 2).sum(axis=(1, 2))
    square = np.maximum((square - total**2 / lines) / np.maximum(1.0 - 1.0 / lines, 0.5), total**2 / near.shape[2])
    return float((total / lines).sum() ** 2 / max((square / lines**2).sum(), 1e-300)) or 1.0


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
