"""Least squares for tracked quantities with white and coloured noise, and estimates of that noise.

Coefficients are ordinary least squares; their covariance is computed for the noise estimated from the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records.array_types import Array

BLOCK = 400  # samples: the noise is estimated from at most BLOCKS blocks of that length, to save time
BLOCKS = 4
_TINY = 1e-12
_SHARES = (0.0, 0.2, 0.5, 0.8, 0.95, 0.99)


@dataclass(frozen=True)
class Noise:
    """Stationary noise with covariance white^2 at lag 0 plus coloured^2 exp(-|lag| / time); lag and ``time`` in s.

    ``white`` and ``coloured`` are standard deviations in the unit of the samples.
    """

    white: float
    coloured: float
    time: float

    @property
    def deviation(self) -> float:
        """Standard deviation of one sample, white and coloured noise together."""
        return float(np.hypot(self.white, self.coloured))


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Least squares: ``coefficients`` [p], their ``covariance`` [p, p], ``residuals`` [N], ``noise`` of these."""

    coefficients: Array
    covariance: Array
    residuals: Array
    noise: Noise


def least_squares(times: Array, design: Array, values: Array, noise: Noise | None = None) -> LinearFit:
    """Fit ``values`` [N] at increasing ``times`` [N] by the columns of ``design`` [N, p]; no value may be NaN.

    If ``noise`` is None, it is estimated from the residuals.
    """
    size = np.maximum(np.sqrt(np.sum(design**2, axis=0)), _TINY)
    X = design / size
    inverse = np.linalg.inv(products(X, X))
    coefficients = inverse @ np.sum(X * values[:, None], axis=0)
    residuals = values - np.sum(X * coefficients, axis=1)
    noise = noise or estimate(times, X, values)
    covariance = inverse @ products(X, correlated(noise, times, X)) @ inverse
    return LinearFit(coefficients / size, covariance / np.outer(size, size), residuals, noise)


def products(a: Array, b: Array) -> Array:
    """Matrix product a^T b [p, q] of tall matrices ``a`` [N, p] and ``b`` [N, q].

    BLAS is not used: on busy cores, synchronising its threads takes a hundred times longer than so small a product.
    """
    return np.asarray(np.einsum("ni,nj->ij", a, b))


def correlated(noise: Noise, times: Array, columns: Array) -> Array:
    """Covariance matrix [N, N] of ``noise`` at ``times`` [N] (s) times ``columns`` [N, p], computed in O(N) time."""
    decay = np.exp(-np.diff(times) / noise.time)
    total = columns.copy()
    for order in (slice(None), slice(None, None, -1)):
        passed, steps, carried = columns[order], decay[order], np.zeros(columns.shape[1])
        sums = np.zeros_like(columns)
        for i, step in enumerate(steps):
            carried = step * (carried + passed[i])
            sums[i + 1] = carried
        total += sums[order]
    return noise.white**2 * columns + noise.coloured**2 * total


def estimate(times: Array, design: Array, values: Array) -> Noise:
    """Noise of ``values`` [N] at ``times`` [N] (s) in a linear model with the ``design`` matrix [N, p].

    By restricted maximum likelihood (Patterson and Thompson 1971, Biometrika 58), which, unlike the variance of the
    residuals, is not biased by the degrees of freedom of the fit. At most ``BLOCKS`` blocks of ``BLOCK`` samples are
    used.
    """
    blocks = _blocks(times, design, values)
    step = float(np.median(np.diff(times)))
    span = max(float(np.max([t[-1] - t[0] for t, _, _ in blocks])), 4 * step)
    scale = float(np.std(values)) + _TINY

    def cost(point: Array) -> float:
        return _restricted(blocks, float(np.clip(point[0], 0, 0.999)), float(np.exp(point[1])), scale)[0]

    lowest, highest = np.log(0.3 * step), np.log(span / 2)
    grid = [np.array([share, t]) for share in _SHARES for t in np.linspace(lowest, highest, 5 if share else 1)]
    start = min(grid, key=cost)
    bounds = [(0.0, 0.999), (lowest, highest)]
    options = {"maxiter": 30, "xatol": 0.02, "fatol": 0.02}
    found = scipy.optimize.minimize(cost, start, method="Nelder-Mead", bounds=bounds, options=options)
    share, time = float(found.x[0]), float(np.exp(found.x[1]))
    variance = _restricted(blocks, share, time, scale)[1]
    return Noise(float(np.sqrt((1 - share) * variance)), float(np.sqrt(share * variance)), time)


Block = tuple[Array, Array, Array]


def _blocks(times: Array, design: Array, values: Array) -> list[Block]:
    starts = np.arange(0, len(times), BLOCK)
    if len(starts) > BLOCKS:
        starts = starts[np.linspace(0, len(starts) - 2, BLOCKS).astype(int)]
    return [(times[s : s + BLOCK], design[s : s + BLOCK], values[s : s + BLOCK]) for s in starts]


def _restricted(blocks: list[Block], share: float, time: float, scale: float) -> tuple[float, float]:
    """Minus twice the restricted log-likelihood (up to a constant) at the most likely variance, and that variance.

    The fraction ``share`` of the variance is coloured, with the correlation time ``time`` (s). Values are divided by
    ``scale`` in the computation; the variance is that of the undivided values.
    """
    shape = Noise(float(np.sqrt(1 - share)), float(np.sqrt(share)), time)
    columns = blocks[0][1].shape[1]
    total, logarithm, count = np.zeros((columns + 1, columns + 1)), 0.0, 0
    for times, design, values in blocks:
        white, logarithms = _whitened(shape, times, np.column_stack([design, values / scale]))
        total += products(white, white)
        logarithm += logarithms
        count += len(values)
    L = np.linalg.cholesky(total[:-1, :-1] + _TINY * np.eye(columns))
    fitted = np.linalg.solve(L, total[:-1, -1])
    free = max(count - columns, 1)
    squares = max(float(total[-1, -1] - fitted @ fitted), _TINY)
    logarithm += 2 * float(np.log(np.diag(L)).sum())
    return float(free * np.log(squares / free) + logarithm), squares / free * scale**2


def _whitened(noise: Noise, times: Array, columns: Array) -> tuple[Array, float]:
    """``columns`` [N, p] whitened for ``noise`` at ``times`` [N] (s), and log of the determinant of its covariance.

    By the Kalman filter of the exponentially correlated part (Jones 1981): exact, and in O(N) time.
    """
    decay = np.exp(-np.diff(times, prepend=times[0]) / noise.time)
    power, nugget = noise.coloured**2, noise.white**2
    white, mean, variance, logarithm = np.empty_like(columns), np.zeros(columns.shape[1]), power, 0.0
    for i, step in enumerate(decay.tolist()):
        mean = step * mean
        variance = step**2 * variance + (1 - step**2) * power
        spread = variance + nugget
        innovation = columns[i] - mean
        white[i] = innovation / np.sqrt(spread)
        mean = mean + (variance / spread) * innovation
        variance *= nugget / spread
        logarithm += np.log(spread)
    return white, float(logarithm)
