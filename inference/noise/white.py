"""Noise that is independent from sample to sample: estimate of its covariance R from residuals.

R follows Armanini et al. (2016, Eq. 22).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records import AnyRecording
from wingfit.records.array_types import Array, Float

FLOOR = 1e-6  # smallest standard deviation relative to the largest recorded value, so that R is not singular
POOLED = 5.0  # samples: weight of the mean variance of a recording in the variance of each track


@dataclass(frozen=True)
class Noise:
    """Noise of the C channels of one recording: covariance R and the matrix W that whitens residuals.

    Attributes:
        covariance: R [C, C], m^2 (tracks) or N^2 (forces).
        whitening: W [C, C]; residuals v [C] of one sample become v W, whose covariance is the identity.
        log_determinants: [C] one term for each channel; their sum is ln det R.
    """

    covariance: Float[Array, "C C"]
    whitening: Float[Array, "C C"]
    log_determinants: Float[Array, " C"]

    @classmethod
    def of(cls, record: AnyRecording, residuals: Float[Array, "T C"]) -> Noise:
        """Estimate R from the residuals [T, C] of ``record`` (NaN: not compared).

        Forces have a full covariance, (1/N) sum of v v^T over N samples v. Tracks have one variance for each of the C
        coordinates and no covariances: from as many frames as coordinates, with gaps, a full matrix would be singular.
        Each variance is a weighted mean of that of the coordinate and of the mean over all (weight: POOLED samples), so
        that a track of a few frames cannot be fitted exactly and dominate. Channels without residuals get variance 1,
        which has no influence.
        """
        if record.kind == "series":
            raise ValueError("the noise of series is that of all recordings; use of_each")
        seen = np.isfinite(residuals)
        v, count = np.where(seen, residuals, 0.0), seen.sum(axis=0)
        if record.kind == "forces":
            matrix = v.T @ v / max(int(count.max()), 1)
        else:
            power = (v**2).sum(axis=0)
            others = POOLED * power.sum() / max(count.sum(), 1)
            matrix = np.diag((power + others) / (count + POOLED))
        largest = np.nanmax(np.abs(record.values), initial=0.0)
        least = (FLOOR * (largest if largest > 0.0 else 1.0)) ** 2
        return cls._of_covariance(matrix + np.diag(np.where(count > 0, least, 1.0 - np.diag(matrix))))

    @classmethod
    def of_each(cls, records: Sequence[AnyRecording], residuals: Sequence[Array]) -> list[Noise]:
        """Estimate the noise of each of ``records`` from its residuals [T, C] (NaN: not compared).

        Each channel of series has a variance of its own, because units differ, but the same in all recordings, because
        the sensor is the same: with one for each recording, a model that fits some of them exactly and others not at
        all would be the most likely.
        """
        if not any(record.kind == "series" for record in records):
            return [cls.of(record, v) for record, v in zip(records, residuals, strict=True)]
        v = np.concatenate(residuals)
        seen = np.isfinite(v)
        power, count = (np.where(seen, v, 0.0) ** 2).sum(axis=0), seen.sum(axis=0)
        largest = np.nanmax(np.abs(np.concatenate([record.values for record in records])), axis=0, initial=0.0)
        least = (FLOOR * np.where(largest > 0.0, largest, 1.0)) ** 2
        noise = cls._of_covariance(np.diag(np.where(count > 0, power / np.maximum(count, 1) + least, 1.0)))
        return [noise] * len(records)

    @classmethod
    def _of_covariance(cls, covariance: Float[Array, "C C"]) -> Noise:
        factor = np.linalg.cholesky(covariance)
        whitening = np.asarray(np.linalg.solve(factor, np.eye(len(factor))).T, float)
        return cls(covariance, whitening, 2.0 * np.log(np.diag(factor)))

    def whitened(self, residuals: Float[Array, "*B T C"]) -> Float[Array, "*B T C"]:
        """Whiten residuals [..., T, C] to unit covariance; zero where they are NaN (not compared)."""
        return np.asarray(np.where(np.isfinite(residuals), residuals, 0.0) @ self.whitening)

    def cost(self, residuals: Float[Array, "T C"]) -> float:
        """Negative log-likelihood of residuals [T, C] (NaN: not compared) under R (Armanini et al. 2016, Eq. 22)."""
        count, white = np.isfinite(residuals).sum(axis=0), self.whitened(residuals)
        return 0.5 * float((white**2).sum() + count @ (self.log_determinants + np.log(2 * np.pi)))


def whitened_sensitivity(noise: Noise, sensitivity: Float[Array, "T C F"]) -> Float[Array, "T C F"]:
    """Derivatives [T, C, F] of whitened residuals with respect to F genes; ``sensitivity``: those of the residuals."""
    return np.asarray(np.einsum("tcf,cd->tdf", sensitivity, noise.whitening, optimize=True))
