"""Noise that is independent from sample to sample: its covariance R, from residuals (Armanini et al. 2016, Eq. 22)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records import Recording
from wingfit.records.array_types import Array, Float

FLOOR = 1e-6  # of the largest recorded value: residuals are taken to be at least this large, so that R stays regular
POOLED = 5.0  # samples: weight of the mean variance of a recording in the variance of each track


@dataclass(frozen=True)
class Noise:
    """Noise covariance R [C, C] of one recording (m^2 or N^2), and the matrix [C, C] W that whitens residuals: v W."""

    covariance: Float[Array, "C C"]
    whitening: Float[Array, "C C"]
    log_determinants: Float[Array, " C"]
    """[C] logarithms that add up to ln det R, one for each channel."""

    @classmethod
    def of(cls, record: Recording, residuals: Float[Array, "T C"]) -> Noise:
        """Estimate R from the residuals [T, C] of ``record``.

        Forces have the full covariance of the fitted axes, (1/N) sum of v v^T. Tracks have one variance for each
        channel: of 120 channels seen for as many frames, with gaps, a full matrix would be singular; each variance is
        shrunk a little towards their mean, so that a track of a few frames cannot be fitted exactly and dominate.
        Channels that are not fitted get variance 1, which has no influence.
        """
        seen = np.isfinite(residuals)
        v, count = np.where(seen, residuals, 0.0), seen.sum(axis=0)
        if record.kind == "forces":
            matrix = v.T @ v / max(int(count.max()), 1)
        else:
            power = (v**2).sum(axis=0)
            matrix = np.diag((power + POOLED * power.sum() / max(count.sum(), 1)) / (count + POOLED))
        largest = float(np.nanmax(np.abs(record.values), initial=0.0)) or 1.0
        matrix = matrix + np.diag(np.where(count > 0, (FLOOR * largest) ** 2, 1.0 - np.diag(matrix)))
        factor = np.linalg.cholesky(matrix)
        whitening = np.asarray(np.linalg.solve(factor, np.eye(len(factor))).T, float)
        return cls(matrix, whitening, 2.0 * np.log(np.diag(factor)))

    def whitened(self, residuals: Float[Array, "*B T C"]) -> Float[Array, "*B T C"]:
        """Residuals [..., T, C] with unit covariance; zero where not compared."""
        return np.asarray(np.where(np.isfinite(residuals), residuals, 0.0) @ self.whitening)

    def cost(self, residuals: Float[Array, "T C"]) -> float:
        """-ln likelihood of residuals [T, C], Eq. 22."""
        count, white = np.isfinite(residuals).sum(axis=0), self.whitened(residuals)
        return 0.5 * float((white**2).sum() + count @ (self.log_determinants + np.log(2 * np.pi)))


def whitened_sensitivity(noise: Noise, sensitivity: Float[Array, "T C F"]) -> Float[Array, "T C F"]:
    """Sensitivities of the whitened residuals, from ``sensitivity`` of the residuals by F genes."""
    return np.asarray(np.einsum("tcf,cd->tdf", sensitivity, noise.whitening, optimize=True))
