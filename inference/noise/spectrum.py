"""The spectral density of measurement noise at the harmonics of the beat, from the lines between them.

A line of density s means that a cosine fitted there to N samples has the variance 2 s / N, as of white noise of
variance s.
"""

from __future__ import annotations

import numpy as np
import scipy

from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

POOLED = 10.0  # lines that the mean scale of all channels counts for in the scale of one
LOCAL = 0.6  # harmonics to either side over which the noise's spectrum is averaged
LOWEST = 3  # lines to which the power law of slow noise is fitted
STEEPEST = -2.0  # exponent of the power law: a random walk
MEAN_LINE = 0.35  # effective frequency, in spectral lines, at which 1/f noise enters the estimate of the mean
FLAT = 0.002  # of the largest density: no density is taken to be lower


def density_at_harmonics(
    scatter: Float[Array, "T C"],
    valid: Bool[Mask, "T C"],
    advance: float,
    number: Int[Index, " T"],
    harmonics: int,
    beats: int,
) -> tuple[Float[Array, " H1"], Float[Array, " C"]]:
    """Density of the noise at harmonics 0 .. H, relative to the scale [C] of each channel (a variance), and that scale.

    ``scatter`` [T, C] is what does not repeat with the beat, zero where not ``valid``; ``advance`` the apparent advance
    of the beat per sample; ``number`` [T] the place of each sample in the regular sequence.
    """
    if beats >= 2:
        parts = np.arange(1, beats) / beats
        lines = (np.arange(harmonics + 1)[:, None] + parts).ravel()
        lines = lines[lines * advance < 0.5]
    else:
        lines = np.arange(harmonics + 1, max(int(0.5 / advance), harmonics + 1) + 1).astype(float)
    turn = np.exp(-2j * np.pi * advance * number[:, None] * lines)
    count = np.maximum(valid.sum(axis=0), 1)
    power = np.abs(turn.T @ scatter) ** 2 / count  # [lines, C]
    used = valid.any(axis=0)
    mean = power[:, used].mean(axis=1)
    scale = np.ones(scatter.shape[1])
    for _ in range(3):
        shape = mean / max(mean.mean(), 1e-300)
        own = (power / np.maximum(shape, FLAT * shape.max())[:, None]).mean(axis=0)
        common = own[used].mean()
        scale = (len(lines) * own + POOLED * common) / (len(lines) + POOLED)
        mean = (power[:, used] / scale[used]).mean(axis=1)
    scale = np.where(used, scale, 1.0)
    if beats >= 3:
        density = np.array([_near(lines, mean, k) for k in range(harmonics + 1)])
    else:
        density = _first_order(lines, mean, advance, harmonics)
    if beats >= 2:
        steep = max(float(density[0]), _at_rest(lines, mean, beats))
        # Between noise that levels off below the lines and noise that does not.
        density[0] = np.sqrt(density[0] * steep)
    return np.maximum(density, FLAT * density.max()), scale


def _at_rest(lines: Array, mean: Array, beats: int) -> float:
    """Density of the noise in the mean of a recording, by the power law of the lowest lines.

    Noise such as 1/f has most of its power below the first line between harmonics, where it moves the mean.
    """
    low = np.argsort(lines)[: max(LOWEST, beats - 1)]
    slope = np.polyfit(np.log(lines[low]), np.log(np.maximum(mean[low], 1e-300)), 1)[0]
    middle = float(np.exp(np.mean(np.log(lines[low]))))
    level = float(np.exp(np.mean(np.log(np.maximum(mean[low], 1e-300)))))
    return float(level * (MEAN_LINE / beats / middle) ** np.clip(slope, STEEPEST, 0.0))


def _near(lines: Array, mean: Array, k: int) -> float:
    near = np.abs(lines - k) <= LOCAL
    return float(mean[near].mean()) if near.any() else float(mean.mean())


def _first_order(lines: Array, mean: Array, advance: float, harmonics: int) -> Array:
    """Density at the harmonics of first-order autoregressive noise beside white noise, by Whittle's likelihood."""

    def model(x: Array, at: Array) -> Array:
        lag1, coloured, white = 0.98 / (1 + np.exp(-x[0])), np.exp(x[1]), np.exp(x[2])
        cosine = np.cos(2 * np.pi * advance * at)
        return np.asarray(coloured * (1 - lag1**2) / (1 + lag1**2 - 2 * lag1 * cosine) + white)

    def cost(x: Array) -> float:
        density = model(x, lines)
        return float(np.sum(np.log(density) + mean / density) + 1e-3 * np.sum(x**2))

    level = np.log(max(float(mean.mean()), 1e-300) / 2)
    best = min(
        (scipy.optimize.minimize(cost, [m, level, level], method="Nelder-Mead") for m in (-1.0, 1.5)),
        key=lambda r: r.fun,
    )
    return model(best.x, np.arange(harmonics + 1, dtype=float))


def lag1_autocorrelation(scatter: Float[Array, "T C"], valid: Bool[Mask, "T C"]) -> float:
    """Correlation of successive samples of ``scatter`` [T, C], zero where not ``valid``; the median of the channels."""
    both = valid[1:] & valid[:-1]
    product = np.where(both, scatter[1:] * scatter[:-1], 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    own = (scatter**2).sum(axis=0) / np.maximum(valid.sum(axis=0), 1)
    good = (own > 0) & both.any(axis=0)
    return float(np.median(product[good] / own[good])) if good.any() else 0.0
