"""Noise that is correlated from sample to sample: its autocovariance, and the covariance of an estimate under it.

Cramer-Rao bounds of white noise are too small for coloured residuals. The covariance of an estimate is then
M^-1 [sum_ij S_i^T R^-1 R_vv(i - j) R^-1 S_j] M^-1 with the information M = sum_i S_i^T R^-1 S_i (Maine and Iliff 1981;
Morelli and Klein 1997, "Accuracy of aerodynamic model parameters estimated from flight test data", Eq. 30). Here
residuals and sensitivities come whitened by R, so that R_vv is a matrix of correlations.

**Lags.** Correlations are estimated up to a lag L and weighted by a flat-topped taper: 1 up to L/2, linear to 0 at L
(Politis and Romano 1995), which hardly biases a correlation that has died out by L/2. L is the least lag that is
MEMORIES times the memory 1 + 2 sum_k rho_k^2 over lags up to L (Bartlett's count of samples per independent one),
and at most a third of the recording. Negative spectral densities are set to zero, so that the result is a covariance.

**Noise that the fit absorbed.** Residuals are noise minus what the fit absorbed, v = (1 - S M^-1 S^T) e, and their
correlations are smaller than the noise's, the more so the longer its memory. The expected loss follows from the noise's
correlations; they are estimated by fixed-point iteration.

**Gaps and uneven frames.** Frames are put on a grid of the median interval; products count where both samples were
seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from wingfit.records.array_types import Array, Bool, Complex, Float, Index, Mask

MEMORIES = 4.0
LARGEST_LAG = 1.0 / 3.0  # of the recording
ROUNDS = 30
SETTLED = 1e-3  # relative change of the score covariance at which the iteration ends


@dataclass(frozen=True)
class Block:
    """One recording, whitened, on a regular time grid of G instants.

    K groups of n outputs each: outputs of a group may be correlated with each other, groups are not. Forces are one
    group of all fitted axes; tracks are as many groups as channels.

    Attributes:
        sensitivity: spectrum [f, K, n, F] of the whitened sensitivities.
        pairs: [lags] number of products that a lag has.
        raw: [lags, n, n] sums of products of residuals, sum_i v_i v_(i+k)^T.
        seen: [G, K] where residuals exist.
        length: of the padded transform.
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
        """Make a block of whitened residuals [T, C] and sensitivities [T, C, F], both zero where not ``seen`` [T, C].

        ``grouped``: the C outputs may be correlated with each other.
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
        """Correlations [lags, n, n] of the noise, not tapered; ``lost`` [lags, n, n]: what the sums lost to the fit."""
        return np.asarray((self.raw + lost) / np.maximum(self.pairs, 1.0)[:, None, None])

    def spectrum(self, correlation: Array, last: int) -> Complex:
        """Spectral density [f, n, n] of correlations tapered at lag ``last``, negative densities set to zero."""
        k = np.arange(last + 1)
        taper = np.clip(2.0 * (1.0 - k / max(last, 1)), 0.0, 1.0)
        kernel = np.zeros((self.length, *correlation.shape[1:]))
        kernel[: last + 1] = np.swapaxes(correlation[: last + 1] * taper[:, None, None], 1, 2)
        kernel[self.length - last :] = np.swapaxes(kernel[last:0:-1], 1, 2)
        density, axes = np.linalg.eigh(rfft(kernel, axis=0))
        return np.asarray((axes * np.maximum(density, 0.0)[:, None, :]) @ np.swapaxes(axes.conj(), 1, 2))

    def through(self, spectrum: Complex) -> Complex:
        """Fourier transform [f, K, n, F] of R_vv S at the frames seen."""
        whole = irfft(np.einsum("fab,fkbp->fkap", spectrum, self.sensitivity), self.length, axis=0)
        whole[: len(self.seen)] *= self.seen[:, :, None, None]
        whole[len(self.seen) :] = 0.0
        return np.asarray(rfft(whole, axis=0))

    def scores(self, through: Complex) -> Array:
        """Covariance [F, F] of the scores, sum_ij S_i^T R_vv(i - j) S_j."""
        flat = self.sensitivity.reshape(len(self.sensitivity), -1, self.sensitivity.shape[-1])
        other = through.reshape(flat.shape)
        weight = np.full(len(flat), 2.0 / self.length)
        weight[0] = 1.0 / self.length
        if self.length % 2 == 0:
            weight[-1] = 1.0 / self.length
        return np.asarray(np.einsum("f,fkp,fkq->pq", weight, flat.conj(), other, optimize=True).real)

    def lost(self, through: Complex, inverse: Array, covariance: Array) -> Array:
        """Expected decrease [lags, n, n] of the sums of products by a fit with M^-1 = ``inverse``."""
        mine = self.sensitivity
        kept = through @ inverse - 0.5 * mine @ covariance
        both = _lagged(mine, kept, self.length) + _lagged(kept, mine, self.length)
        return both[: len(self.pairs)]


def grid(times: Array, longest: int) -> Index:
    """Index [T] of each frame on a grid of the median interval; a pause counts for at most ``longest`` + 1 intervals.

    Where two frames would get one index, because frames are too uneven, all are numbered 0, 1, 2, ...
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
    """Covariance [F, F] of each block's scores, by the fixed-point iteration above; ``inverse`` is M^-1."""
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
    """The lag L of the taper, for correlations [lags, n, n]."""
    own = np.trace(correlation, axis1=1, axis2=2)
    rho = own / own[0] if own[0] > 0 else np.zeros(len(own))
    memory = 1.0 + 2.0 * np.cumsum(np.where(np.arange(len(rho)) > 0, rho, 0.0) ** 2)
    enough = np.flatnonzero(np.arange(len(rho)) >= MEMORIES * memory)
    return int(enough[0]) if len(enough) else len(rho) - 1


def _lagged(a: Complex, b: Complex, length: int) -> Array:
    """[lag, n, n] of sum_i a_i b_(i + lag)^T over groups and columns, from spectra [f, K, n, P]."""
    return np.asarray(irfft(np.einsum("fkap,fkbp->fab", a.conj(), b, optimize=True), length, axis=0))
