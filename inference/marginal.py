"""Linear nuisance parameters with normal priors, integrated out of whitened residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float

NEGLIGIBLE = 1e-9  # of the largest singular value: a parameter that the residuals do not show


@dataclass(frozen=True)
class Marginal:
    """K nuisance parameters with standard normal priors that change N whitened residuals linearly.

    With noise of unit covariance and the changes A [N, K], the residuals have the covariance 1 + A A^T (Rasmussen and
    Williams 2006, Sec. 2.7: explicit basis functions with a normal prior).

    Attributes:
        basis: [N, M] left singular vectors of A.
        gain: [M] its singular values.
        mix: [M, K] its right singular vectors.
    """

    basis: Float[Array, "N M"]
    gain: Float[Array, " M"]
    mix: Float[Array, "M K"]

    @classmethod
    def of(cls, changes: Float[Array, "N K"]) -> Marginal:
        """Decompose ``changes`` [N, K] of the residuals by one standard deviation of each parameter."""
        square, vectors = np.linalg.eigh(changes.T @ changes)  # K is far less than N
        gain = np.sqrt(np.maximum(square, 0.0))
        shown = gain > NEGLIGIBLE * gain.max(initial=0.0)
        gain, mix = gain[shown], vectors[:, shown].T
        return cls(np.asarray(changes @ mix.T / gain), gain, np.asarray(mix))

    def whiten(self, residuals: Float[Array, "*B N"]) -> Float[Array, "*B N"]:
        """Return (1 + A A^T)^(-1/2) times ``residuals`` [..., N]: of unit covariance again."""
        less = 1.0 - 1.0 / np.sqrt(1.0 + self.gain**2)
        return np.asarray(residuals - ((residuals @ self.basis) * less) @ self.basis.T)

    def restore(self, whitened: Float[Array, "*B N"]) -> Float[Array, "*B N"]:
        """Return the residuals [..., N] of which :meth:`whiten` made ``whitened``."""
        more = np.sqrt(1.0 + self.gain**2) - 1.0
        return np.asarray(whitened + ((whitened @ self.basis) * more) @ self.basis.T)

    def of_part(self, part: slice) -> Marginal:
        """Return the same parameters, integrated out of a ``part`` of the residuals alone."""
        return Marginal.of(self.basis[part] * self.gain)

    def estimates(self, whitened: Float[Array, " N"]) -> Float[Array, " K"]:
        """Return the posterior mean [K] of the parameters from ``whitened`` [N], which :meth:`whiten` returned."""
        return np.asarray((whitened @ self.basis * (self.gain / np.sqrt(1.0 + self.gain**2))) @ self.mix)
