"""Spectral density of measurement noise at the harmonics of the beat, estimated from the spectral lines between them.

Frequencies are multiples of the flap frequency ("lines"). A density s at a line means that the amplitude of a cosine
fitted there to N samples has the variance 2 s / N, as in white noise of variance s.
"""

from __future__ import annotations

import numpy as np
import scipy

from wingfit.records.array_types import Array, Bool, Complex, Float, Index, Int, Mask

POOLED = 10.0  # weight, in lines, of the mean scale of all channels in the scale of one channel
LOCAL = 0.6  # multiples of the flap frequency to either side of a harmonic over which lines are averaged
LOWEST = 3  # lines to which the power law of slow noise is fitted
STEEPEST = -2.0  # exponent of the power law: a random walk
MEAN_LINE = 0.35  # effective frequency, in spectral lines, at which 1/f noise enters the estimate of the mean
BESIDE = 0.75  # spectral lines on either side of a removed frequency that are not used
NONE = np.zeros(0)
MOST_LINES = 63  # between neighbouring harmonics: of longer recordings, as many are used, evenly spread
BLOCK = 4_000_000  # products of sample and line that are in memory at a time
FLAT = 0.002  # smallest density, relative to the largest


def density_at_harmonics(
    scatter: Float[Array, "T C"],
    valid: Bool[Mask, "T C"],
    advance: float,
    number: Int[Index, " T"],
    harmonics: int,
    beats: int,
    removed: Float[Array, " L"] = NONE,
) -> tuple[Float[Array, " H1"], Float[Array, " C"]]:
    """Return the density [H + 1] of the noise at harmonics 0 .. H, and the scale [C] of each channel (a variance).

    The density is common to all channels; that of one channel is the product with its scale. ``scatter`` [T, C]: part
    of the recording that differs from beat to beat, zero where not ``valid``. ``advance``: apparent advance of the beat
    per sample, beats. ``number`` [T]: index of each sample in the regular sequence of samples. ``harmonics``: H.
    ``beats``: whole (apparent) beats recorded; ``removed``: frequencies (apparent) that the scatter does not have,
    because what is there is no noise. Time grows with T H, memory with T.
    """
    if beats >= 2:
        count = min(beats - 1, MOST_LINES)
        parts = np.round(np.linspace(1, beats - 1, count)) / beats
        lines = (np.arange(harmonics + 1)[:, None] + parts).ravel()
        lines = lines[lines * advance < 0.5]
        near = np.abs(lines[:, None] - removed) * beats < BESIDE
        lines = lines[~near.any(axis=1)]
    else:
        lines = np.arange(harmonics + 1, max(int(0.5 / advance), harmonics + 1) + 1).astype(float)
    power = np.abs(_transform(scatter, advance, number, lines)) ** 2 / np.maximum(valid.sum(axis=0), 1)  # [lines, C]
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
        # Geometric mean of noise that is constant below the lowest line and noise that follows the power law.
        density[0] = np.sqrt(density[0] * steep)
    return np.maximum(density, FLAT * density.max()), scale


def _transform(scatter: Array, advance: float, number: Index, lines: Array) -> Complex:
    """Fourier transform [L, C] of ``scatter`` [T, C] at ``lines`` [L]; the rest as in :func:`density_at_harmonics`."""
    step = max(BLOCK // len(lines), 1)
    total = np.zeros((len(lines), scatter.shape[1]), complex)
    for start in range(0, len(scatter), step):
        part = slice(start, start + step)
        total += np.exp(-2j * np.pi * advance * number[part, None] * lines).T @ scatter[part]
    return total


def _at_rest(lines: Array, mean: Array, beats: int) -> float:
    """Density of the noise in the mean of a recording, extrapolated from the lowest lines by a power law.

    Most of the power of noise such as 1/f lies below the lowest line between harmonics, where it shifts the mean.
    ``lines`` [L] in multiples of the flap frequency, ``mean`` [L]: density at each, averaged over the channels.
    """
    low = np.argsort(lines)[: max(LOWEST, min(beats - 1, MOST_LINES))]
    slope = np.polyfit(np.log(lines[low]), np.log(np.maximum(mean[low], 1e-300)), 1)[0]
    middle = float(np.exp(np.mean(np.log(lines[low]))))
    level = float(np.exp(np.mean(np.log(np.maximum(mean[low], 1e-300)))))
    return float(level * (MEAN_LINE / beats / middle) ** np.clip(slope, STEEPEST, 0.0))


def _near(lines: Array, mean: Array, k: int) -> float:
    near = np.abs(lines - k) <= LOCAL
    return float(mean[near].mean()) if near.any() else float(mean.mean())


def _first_order(lines: Array, mean: Array, advance: float, harmonics: int) -> Array:
    """Density [H + 1] at harmonics 0 .. H of first-order autoregressive plus white noise, fitted to the lines.

    Whittle's likelihood is maximised. ``lines`` [L]: frequencies in multiples of the flap frequency; ``mean`` [L]:
    density at each; ``advance``: apparent advance of the beat per sample, beats.
    """
    kept = mean >= FLAT * mean.max()  # what a low-pass has removed says nothing of the noise where it passes
    lines, mean = lines[kept], mean[kept]

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
    """Correlation of successive samples of ``scatter`` [T, C] (zero where not ``valid``): the median of the channels.

    0 if no channel has two successive valid samples.
    """
    both = valid[1:] & valid[:-1]
    product = np.where(both, scatter[1:] * scatter[:-1], 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    own = (scatter**2).sum(axis=0) / np.maximum(valid.sum(axis=0), 1)
    good = (own > 0) & both.any(axis=0)
    return float(np.median(product[good] / own[good])) if good.any() else 0.0
