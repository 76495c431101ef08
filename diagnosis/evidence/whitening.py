"""The linear map that gives the noise of coefficients unit covariance.

The noise of channels is independent, except that of the three coordinates of a marker where the dataset states
correlations: cameras see a position far better across their line of sight than along it, and this line is no axis of
the wing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wingfit.inference.noise.harmonic import HarmonicFit
from wingfit.records.array_types import Array, Float


class Correlated(NamedTuple):
    """Coefficients ``part`` of a recording whose coordinates have correlated noise: M markers, P coefficients each.

    ``whiten`` and ``restore`` [M, P, 3, 3]: C^-1/2 and C^1/2 of the covariance C of the three coordinates.
    """

    part: slice
    whiten: Float[Array, "M P 3 3"]
    restore: Float[Array, "M P 3 3"]


@dataclass(frozen=True)
class Whitening:
    """Divides coefficients [D] by the standard deviations ``scale`` [D], and those ``correlated`` by a matrix."""

    scale: Float[Array, " D"]
    correlated: tuple[Correlated, ...] = ()

    @classmethod
    def of(cls, scale: Float[Array, " D"], fits: Sequence[object], slices: Sequence[slice]) -> Whitening:
        """Return the whitening of the recordings that ``fits`` reduced to the coefficients in ``slices``.

        ``scale`` [D]: of each coefficient, by its noise and by what any model may be wrong by, which is independent.
        """
        found = [
            _correlated(scale[part], fit, fit.correlation, part)
            for fit, part in zip(fits, slices, strict=True)
            if isinstance(fit, HarmonicFit) and fit.correlation is not None
        ]
        return cls(scale, tuple(found))

    def whiten(self, coefficients: Float[Array, "*B D"]) -> Float[Array, "*B D"]:
        """Return ``coefficients`` [..., D] relative to their noise, which then has unit covariance."""
        found = np.asarray(coefficients / self.scale)
        for part, matrix, _ in self.correlated:
            found[..., part] = _times(matrix, coefficients[..., part])
        return found

    def restore(self, whitened: Float[Array, "*B D"]) -> Float[Array, "*B D"]:
        """Return the coefficients [..., D] of which :meth:`whiten` made ``whitened``."""
        found = np.asarray(whitened * self.scale)
        for part, _, matrix in self.correlated:
            found[..., part] = _times(matrix, whitened[..., part])
        return found

    def of_part(self, part: slice) -> Whitening:
        """Return the whitening of the recording whose coefficients are ``part`` alone."""
        own = tuple(one._replace(part=slice(None)) for one in self.correlated if one.part == part)
        return Whitening(self.scale[part], own)


def _correlated(scale: Float[Array, " D"], fit: HarmonicFit, correlation: Array, part: slice) -> Correlated:
    shape = -1, 3, len(fit.order)  # a marker has all three coordinates or none
    noise = np.sqrt(fit.variance[fit.used]).reshape(shape).swapaxes(1, 2)
    covariance = noise[..., :, None] * correlation[fit.used[::3], None] * noise[..., None, :]
    covariance[..., range(3), range(3)] = scale.reshape(shape).swapaxes(1, 2) ** 2
    square, vectors = np.linalg.eigh(covariance)
    turned = vectors.swapaxes(-1, -2)
    return Correlated(
        part, (vectors / np.sqrt(square)[..., None, :]) @ turned, (vectors * np.sqrt(square)[..., None, :]) @ turned
    )


def _times(matrix: Float[Array, "M P 3 3"], coefficients: Float[Array, "*B D"]) -> Float[Array, "*B D"]:
    shape = *coefficients.shape[:-1], len(matrix), 3, matrix.shape[1]
    found = np.einsum("mpij,...mjp->...mip", matrix, coefficients.reshape(shape), optimize=True)
    return np.asarray(found.reshape(coefficients.shape))
