"""Least-squares fits of harmonics of the flap frequency to channels with gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wingfit.records.array_types import Array, Float, Mask

MOST_ROWS = 1500  # that are fitted
OUTLIER = 6.0  # residuals beyond so many robust standard deviations are left out of the second fit
SCALE = 1.4826  # standard deviation of Gaussian noise over its median absolute deviation


class Waves(NamedTuple):
    """Harmonics of C channels: ``mean`` [C], complex amplitudes ``waves`` [K, C], and ``sigma`` [C] of the residual.

    A channel is mean + Re sum_k waves_k exp(2 pi i k f t).
    """

    mean: Array
    waves: Array
    sigma: Array

    def at(self, times: Float[Array, " T"], frequency: float) -> Array:
        """Return the fitted channels [T, C] at ``times`` (s)."""
        k = np.arange(1, len(self.waves) + 1)
        turn = np.exp(2j * np.pi * frequency * times[:, None] * k)
        return np.asarray(self.mean + (turn @ self.waves).real)


def thin(count: int, most: int) -> slice:
    """Return a slice of at most ``most`` of ``count`` rows, evenly spread."""
    return slice(None, None, max(1, -(-count // most)))


def design(times: Float[Array, " T"], frequency: float, harmonics: int) -> Array:
    """Columns [T, 2 K + 1]: one, then cosine and sine of each harmonic of ``frequency`` (Hz)."""
    turn = 2.0 * np.pi * frequency * times[:, None] * np.arange(1, harmonics + 1)
    both = np.stack([np.cos(turn), np.sin(turn)], axis=2).reshape(len(times), -1)
    return np.column_stack([np.ones_like(times), both])


def fit(times: Float[Array, " T"], values: Float[Array, "T C"], frequency: float, harmonics: int) -> Waves:
    """Fit ``harmonics`` of ``frequency`` (Hz) to the channels ``values`` [T, C], NaN where missing, less outliers."""
    rows = thin(len(times), MOST_ROWS)
    times, values = times[rows], values[rows]
    basis, seen = design(times, frequency, harmonics), np.isfinite(values)
    coefficients = _solve(basis, values, seen)
    residual = np.abs(np.where(seen, values - basis @ coefficients, np.nan))
    sigma = _middle(residual)
    near = seen & (residual <= np.maximum(OUTLIER * sigma, 1e-12))
    coefficients = _solve(basis, values, near)
    sigma = _middle(np.abs(np.where(seen, values - basis @ coefficients, np.nan)))
    return Waves(coefficients[0], coefficients[1::2] - 1j * coefficients[2::2], sigma)


def _solve(basis: Array, values: Array, seen: Mask) -> Array:
    """Coefficients [P, C] of ``basis`` [T, P] for the channels of ``values`` [T, C] where they are ``seen``."""
    width = basis.shape[1]
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
    normal = (seen.T.astype(float) @ products).reshape(-1, width, width)
    right = (basis.T @ np.where(seen, values, 0.0)).T
    scale = np.maximum(seen.sum(axis=0), 1)[:, None, None]
    return np.linalg.solve(normal / scale + 1e-9 * np.eye(width), (right / scale[:, :, 0])[..., None])[..., 0].T


def _middle(residual: Array) -> Array:
    """Robust standard deviation [C] of the absolute ``residual`` [T, C]; 0 for a channel without samples."""
    empty = ~np.isfinite(residual).any(axis=0)
    return np.asarray(SCALE * np.nanmedian(np.where(empty, 0.0, residual), axis=0))
