"""Noise that is correlated from sample to sample: its autocovariance, and the covariance of an estimate under it.

For such coloured noise, the Cramer-Rao bounds of white noise are too small. The covariance of an estimate is then M^-1
[sum_ij S_i^T R^-1 R_vv(i - j) R^-1 S_j] M^-1 with the information M = sum_i S_i^T R^-1 S_i (Maine and Iliff 1981;
Morelli and Klein 1997, "Accuracy of aerodynamic model parameters estimated from flight test data", Eq. 30). S_i are the
sensitivities of sample i (derivatives of its n outputs with respect to F genes), R is the noise covariance of a sample,
and R_vv(k) the covariance of samples k apart. All residuals and sensitivities in this module are whitened by R, so that
R vanishes from the formulas and R_vv is a matrix of correlations. The bracket is the covariance of the *scores*, the
derivatives of the log-likelihood with respect to the genes.

**Lags.** Correlations are estimated up to a lag L and multiplied by a flat-topped taper: 1 up to L/2, then linear to 0
at L (Politis and Romano 1995), which hardly biases a correlation that has decayed by L/2. L is the smallest lag that is
at least MEMORIES times 1 + 2 sum_k rho_k^2, the number of samples per independent sample (Bartlett), with the
correlations rho_k up to lag L. L is at most a third of the recording. Negative spectral densities are set to zero, so
that the result is a covariance.

**Noise that the fit absorbed.** Residuals are the noise e minus the part that the fit absorbed: v = (1 - S M^-1 S^T) e.
Their correlations are smaller than those of the noise, the more so the longer the noise is correlated. The expected
decrease follows from the correlations of the noise, so both are estimated together by fixed-point iteration.

**Gaps and uneven frames.** Samples are assigned to a regular grid of the median interval. A product of two samples
counts only where both were recorded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from wingfit.records.array_types import Array, Bool, Complex, Float, Index, Mask

MEMORIES = 4.0
LARGEST_LAG = 1.0 / 3.0  # as a fraction of the recording
ROUNDS = 30
SETTLED = 1e-3  # relative change of the score covariance at which the iteration ends


@dataclass(frozen=True)
class Block:
    """One recording, whitened, on a regular time grid of G instants, with the sums that its autocorrelation needs.

    Outputs form K groups of n outputs: outputs of one group may be correlated with each other, those of different
    groups are not. Forces are one group of all fitted axes (K = 1); tracks are groups of one coordinate each (n = 1).

    Attributes:
        sensitivity: discrete Fourier transform [f, K, n, F] along time of the whitened sensitivities to F genes.
        pairs: [lags] number of products in the sum for each lag.
        raw: [lags, n, n] sums of products of residuals at each lag k, sum_i v_i v_(i+k)^T.
        seen: [G, K], True where residuals exist.
        length: number of samples of the zero-padded transform.
    """

    sensitivity: Complex
    pairs: Float[Array, " lags"]
    raw: Float[Array, "lags n n"]
    seen: Bool[Mask, "G K"]
    length: int

    @classmethod
    def of(
        cls,
        times: Float[Array, " T"],
        white: Float[Array, "T C"],
        sensitivity: Float[Array, "T C F"],
        seen: Bool[Mask, "T C"],
        *,
        grouped: bool,
    ) -> Block:
        """Make a block from a recording's whitened residuals and sensitivities.

        ``times`` [T], s; ``white`` [T, C]: whitened residuals, and ``sensitivity`` [T, C, F], both zero where not
        ``seen`` [T, C]. ``grouped``: the C outputs may be correlated with each other and form one group.
        """
        frames, outputs, genes = sensitivity.shape
        shape = (1, outputs) if grouped else (outputs, 1)
        lags = max(1, int(LARGEST_LAG * frames))
        slots = grid(times, lags)
        size = int(slots[-1]) + 1
        length = next_fast_len(size + lags + 1, real=True)

        def spread(values: Array, trailing: tuple[int, ...]) -> Complex:
            whole = np.zeros((size, *trailing))
            whole[slots] = values.reshape(frames, *trailing)
            return np.asarray(rfft(whole, length, axis=0))

        groups = np.zeros((size, shape[0]), bool)
        groups[slots] = seen.reshape(frames, *shape).all(axis=2)
        count = rfft(groups.astype(float), length, axis=0)
        pairs = irfft((np.abs(count) ** 2).sum(axis=1), length)[: lags + 1]
        residual = spread(white, shape)
        raw = _lagged(residual[..., None], residual[..., None], length)[: lags + 1]
        return cls(spread(sensitivity, (*shape, genes)), np.maximum(np.round(pairs), 0.0), raw, groups, length)

    def correlation(self, lost: Array) -> Array:
        """Correlations [lags, n, n] of the noise, not tapered.

        ``lost`` [lags, n, n]: decrease of the sums of products by the fit, which is added to them again.
        """
        return np.asarray((self.raw + lost) / np.maximum(self.pairs, 1.0)[:, None, None])

    def spectrum(self, correlation: Array, last: int) -> Complex:
        """Spectral density [f, n, n] of a ``correlation`` [lags, n, n] tapered to zero at lag ``last``.

        Negative densities (eigenvalues) are set to zero.
        """
        k = np.arange(last + 1)
        taper = np.clip(2.0 * (1.0 - k / max(last, 1)), 0.0, 1.0)
        kernel = np.zeros((self.length, *correlation.shape[1:]))
        kernel[: last + 1] = np.swapaxes(correlation[: last + 1] * taper[:, None, None], 1, 2)
        kernel[self.length - last :] = np.swapaxes(kernel[last:0:-1], 1, 2)
        density, axes = np.linalg.eigh(rfft(kernel, axis=0))
        return np.asarray((axes * np.maximum(density, 0.0)[:, None, :]) @ np.swapaxes(axes.conj(), 1, 2))

    def through(self, spectrum: Complex) -> Complex:
        """Discrete Fourier transform [f, K, n, F] of sum_j R_vv(i - j) S_j, set to zero at instants not recorded.

        ``spectrum`` [f, n, n] is the spectral density of R_vv, S the sensitivities.
        """
        whole = irfft(np.einsum("fab,fkbp->fkap", spectrum, self.sensitivity), self.length, axis=0)
        whole[: len(self.seen)] *= self.seen[:, :, None, None]
        whole[len(self.seen) :] = 0.0
        return np.asarray(rfft(whole, axis=0))

    def scores(self, through: Complex) -> Array:
        """Covariance [F, F] of the scores, sum_ij S_i^T R_vv(i - j) S_j.

        ``through`` [f, K, n, F] is the result of :meth:`through`.
        """
        flat = self.sensitivity.reshape(len(self.sensitivity), -1, self.sensitivity.shape[-1])
        other = through.reshape(flat.shape)
        weight = np.full(len(flat), 2.0 / self.length)
        weight[0] = 1.0 / self.length
        if self.length % 2 == 0:
            weight[-1] = 1.0 / self.length
        return np.asarray(np.einsum("f,fkp,fkq->pq", weight, flat.conj(), other, optimize=True).real)

    def lost(self, through: Complex, inverse: Array, covariance: Array) -> Array:
        """Decrease [lags, n, n] of the sums of products of residuals that a fit of the genes is expected to cause.

        ``through``: result of :meth:`through`; ``inverse`` [F, F]: M^-1; ``covariance`` [F, F] of the estimate.
        """
        mine = self.sensitivity
        kept = through @ inverse - 0.5 * mine @ covariance
        both = _lagged(mine, kept, self.length) + _lagged(kept, mine, self.length)
        return both[: len(self.pairs)]


def grid(times: Array, longest: int) -> Index:
    """Assign each of the frames at ``times`` [T] to an index [T] on a regular grid of the median interval, from 0.

    A pause counts for at most ``longest`` + 1 intervals. Frames so uneven that two of them would have the same index
    are numbered 0, 1, 2, ... instead.
    """
    if len(times) < 2:
        return np.zeros(len(times), np.int64)
    steps = np.diff(times)
    slots = np.round((times - times[0]) / np.median(steps)).astype(np.int64)
    apart = np.diff(slots)
    if (apart < 1).any():
        return np.arange(len(times))
    return np.concatenate([[0], np.cumsum(np.minimum(apart, longest + 1))])


def score_covariances(blocks: list[Block], inverse: Float[Array, "F F"]) -> list[Array]:
    """Covariance [F, F] of the scores of each block, by the fixed-point iteration that the module's text describes.

    ``inverse`` [F, F] is M^-1, the inverse information of all blocks together.
    """
    lost = [np.zeros_like(block.raw) for block in blocks]
    each, total = [np.zeros_like(inverse)] * len(blocks), np.zeros_like(inverse)
    for _ in range(ROUNDS):
        correlations = [block.correlation(missing) for block, missing in zip(blocks, lost, strict=True)]
        images = [b.through(b.spectrum(rho, last_lag(rho))) for b, rho in zip(blocks, correlations, strict=True)]
        each = [block.scores(image) for block, image in zip(blocks, images, strict=True)]
        before, total = total, np.asarray(sum(each), float)
        if np.abs(total - before).max() <= SETTLED * np.abs(total).max():
            break
        covariance = inverse @ total @ inverse
        lost = [block.lost(image, inverse, covariance) for block, image in zip(blocks, images, strict=True)]
    return each


def last_lag(correlation: Array) -> int:
    """Return the lag L at which the taper reaches zero (see the module's text) for ``correlation`` [lags, n, n]."""
    own = np.trace(correlation, axis1=1, axis2=2)
    rho = own / own[0] if own[0] > 0 else np.zeros(len(own))
    memory = 1.0 + 2.0 * np.cumsum(np.where(np.arange(len(rho)) > 0, rho, 0.0) ** 2)
    enough = np.flatnonzero(np.arange(len(rho)) >= MEMORIES * memory)
    return int(enough[0]) if len(enough) else len(rho) - 1


def _lagged(a: Complex, b: Complex, length: int) -> Array:
    """Sums of products sum_i a_i b_(i + lag)^T for each lag, [length, n, n], added over K groups and P columns.

    ``a``, ``b``: discrete Fourier transforms [f, K, n, P] along time; ``length``: number of samples of the transform.
    """
    return np.asarray(irfft(np.einsum("fkap,fkbp->fab", a.conj(), b, optimize=True), length, axis=0))
