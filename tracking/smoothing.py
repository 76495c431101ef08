"""A periodic motion as a Fourier series, with the errors of its value and of its derivatives.

There are two errors: the noise that the fit passes to the series, and the motion beyond the last harmonic. More
harmonics reduce the truncation error and increase the noise; harmonic k adds noise to the d-th derivative as k^d.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from wingfit.records.array_types import Array, Index
from wingfit.records.blas_threads import one_blas_thread
from wingfit.tracking.noise import LinearFit, Noise, least_squares, products

DERIVATIVES = 3
MAX_HARMONICS = 30
_GRID = 360
_SIGNIFICANT = 3.0  # standard errors, from which on an amplitude counts as motion
_UNLIKELY = 0.01  # p value below which beats differ by more than the noise
_LEAST_EXPONENT = 3.0
_FOLDS = 10
_UNDETERMINED = 1e8


@dataclass(frozen=True, eq=False)
class PeriodicFit:
    """Fitted series: mean + sum_k [cosine_k cos(2 pi k t*) + sine_k sin(2 pi k t*)], t* = frequency (t - start).

    Attributes:
        frequency: of the beat, Hz; ``start``: a time at which t* = 0, s.
        coefficients: [1 + 2 K] mean, cosine_1, sine_1, cosine_2, ...; ``covariance``: of these, under coloured noise.
        noise: white and coloured noise of the samples.
        lost: [4] bound on the RMS over the beat of the harmonics beyond K, for value and derivatives (unit / s^d);
            infinite if the amplitudes decrease too slowly for the derivative to be square integrable.
        scores: [K_max] RMS error of cross-validation for 1, 2, ... harmonics; empty if K was given.
        beats: number of beats with samples; ``samples``: number of samples; ``remarks``: warnings about the fit.
    """

    frequency: float
    start: float
    coefficients: Array
    covariance: Array
    noise: Noise
    lost: Array
    scores: tuple[float, ...]
    beats: int
    samples: int
    remarks: tuple[str, ...] = ()

    @property
    def harmonics(self) -> int:
        """Number K of harmonics."""
        return len(self.coefficients) // 2

    @one_blas_thread
    def at(self, phase: Array, derivative: int = 0) -> Array:
        """Value of the series at ``phase`` t* [...], or its d-th time derivative, d = ``derivative`` (unit / s^d)."""
        return basis(phase, self.harmonics, derivative, self.frequency) @ self.coefficients

    @one_blas_thread
    def error_at(self, phase: Array, derivative: int = 0) -> Array:
        """Standard error of :meth:`at` from noise alone, without the truncation error ``lost``."""
        B = basis(phase, self.harmonics, derivative, self.frequency)
        return np.asarray(np.sqrt(np.einsum("...i,ij,...j->...", B, self.covariance, B)))

    @property
    def passed(self) -> Array:
        """RMS over the beat of the standard error by noise of value and first three derivatives [4], unit / s^d."""
        errors = np.stack([self.error_at(_phases(), d) for d in range(DERIVATIVES + 1)])
        return np.asarray(np.sqrt(np.mean(errors**2, axis=1)))

    @property
    def error(self) -> Array:
        """RMS over the beat of noise and truncation error together, of value and three derivatives [4], unit / s^d."""
        return np.hypot(self.passed, self.lost)

    @property
    def amplitude(self) -> Array:
        """RMS over the beat of the series about its mean, and of its first three derivatives [4], unit / s^d."""
        return np.array([float(np.std(self.at(_phases(), d))) for d in range(DERIVATIVES + 1)])

    @property
    def series(self) -> tuple[float, tuple[float, ...], tuple[float, ...]]:
        """Mean, cosine and sine coefficients as :class:`wingfit.records.FourierFlap` takes them."""
        c = self.coefficients
        return float(c[0]), tuple(c[1::2].tolist()), tuple(c[2::2].tolist())

    def shifted(self, phase: float) -> PeriodicFit:
        """The same motion, with the instant at t* = ``phase`` as the new origin t* = 0."""
        turn = _turn(self.harmonics, phase)
        return replace(
            self,
            start=self.start + phase / self.frequency,
            coefficients=turn @ self.coefficients,
            covariance=turn @ self.covariance @ turn.T,
        )


@one_blas_thread
def fit_periodic(
    times: Array, values: Array, frequency: float, harmonics: int | None = None, start: float = 0.0
) -> PeriodicFit:
    """Fit a periodic series of known ``frequency`` (Hz) to ``values`` [N] at ``times`` [N] (s) over several beats.

    ``times`` increase, evenly or not; NaN in ``values`` is a gap; the phase is zero at ``start`` (s). Without
    ``harmonics`` their number is chosen by cross-validation over beats (Stone 1974); with fewer than three beats, over
    samples, so that correlated noise may be mistaken for motion. ValueError if the samples are too few for a series, or
    for that many ``harmonics``.
    """
    seen = np.isfinite(values)
    times, values = times[seen], values[seen]
    phase = (times - start) * frequency
    most = _most_harmonics(phase)
    if harmonics is not None and not 1 <= harmonics <= most:
        raise ValueError(
            f"{harmonics} harmonics; {len(values)} samples with these gaps in phase determine 1 to {most}: "
            "request fewer, or give more samples"
        )
    beats, group = np.unique(np.floor(phase - phase[0]), return_inverse=True)
    groups = group if len(beats) >= 3 else np.arange(len(values)) % _FOLDS
    scores = () if harmonics else _predictions(phase, values, groups, most)
    chosen = harmonics or 1 + int(np.argmin(scores))
    # The noise is estimated about a longer series, so that truncated motion does not count as noise.
    wide = least_squares(times, basis(phase, min(2 * chosen + 2, most)), values)
    linear = least_squares(times, basis(phase, chosen), values, wide.noise)
    covariance, remarks = _between_beats(phase, linear, group, len(beats))
    if len(beats) < 3 and not harmonics:
        few = f"{len(beats)} beat(s) only: slow noise cannot be distinguished from motion; record three beats or more"
        remarks = (*remarks, few)
    return PeriodicFit(
        frequency, start, linear.coefficients, covariance, linear.noise, _lost(wide, chosen, frequency), scores,
        len(beats), len(values), remarks,
    )  # fmt: skip


def basis(phase: Array, harmonics: int, derivative: int = 0, frequency: float = 1.0) -> Array:
    """Values at ``phase`` t* [...] of 1, cos 2 pi t*, sin 2 pi t*, ... up to K = ``harmonics``: [..., 1 + 2 K].

    With ``derivative`` d above 0: their d-th derivatives by time (1 / s^d) at ``frequency`` (Hz).
    """
    k = np.arange(1, harmonics + 1)
    angle = 2 * np.pi * np.multiply.outer(phase, k)
    factor = (2 * np.pi * frequency * k) ** derivative
    columns = np.zeros((*np.shape(phase), 1 + 2 * harmonics))
    columns[..., 0] = float(derivative == 0)
    columns[..., 1::2] = factor * np.cos(angle + derivative * np.pi / 2)
    columns[..., 2::2] = factor * np.sin(angle + derivative * np.pi / 2)
    return columns


def _turn(harmonics: int, phase: float) -> Array:
    angles = 2 * np.pi * phase * np.arange(1, harmonics + 1)
    return np.asarray(
        scipy.linalg.block_diag(1.0, *([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in angles))
    )


def _most_harmonics(phase: Array) -> int:
    """Largest number of harmonics that samples at ``phase`` [N] (beats) determine; ValueError if none.

    Each coefficient needs three samples, and no gap in phase may exceed half a wavelength of the last harmonic.
    """
    folded = np.sort(phase % 1.0)
    gap = float(np.max(np.diff(np.append(folded, folded[0] + 1)))) if len(folded) else 1.0
    most = min(MAX_HARMONICS, (len(folded) // 3 - 1) // 2, int(0.5 / gap - 1e-6))
    if most < 1:
        raise ValueError(
            f"{len(folded)} samples with the largest gap {gap:.2f} of a beat; a series needs at least 9 samples and "
            "no gap above half a beat: give more samples or beats"
        )
    return most


def _predictions(phase: Array, values: Array, groups: Index, most: int) -> tuple[float, ...]:
    """RMS error of predicting each group of samples from the other groups, for 1 to ``most`` harmonics.

    It is infinite where the other groups do not determine the series. ``groups`` [N]: group of each sample.
    """
    X, y = basis(phase, most), values - values.mean()
    parts = [(X[groups == g], y[groups == g]) for g in np.unique(groups)]
    squares = np.stack([products(x, x) for x, _ in parts])
    rights = np.stack([np.sum(x * y[:, None], axis=0) for x, y in parts])
    power = float(np.sum(y**2))
    scores = []
    for k in range(1, most + 1):
        p = 1 + 2 * k
        G, c = squares[:, :p, :p], rights[:, :p]
        others = G.sum(axis=0) - G
        if np.linalg.cond(others).max() > _UNDETERMINED:
            scores.append(float("inf"))  # without some group the series is not determined
            continue
        b = np.linalg.solve(others, (c.sum(axis=0) - c)[..., None])[..., 0]
        error = power - 2 * np.sum(b * c) + np.einsum("gi,gij,gj->", b, G, b)
        scores.append(float(np.sqrt(max(error, 0.0) / len(y))))
    return tuple(scores)


def _between_beats(phase: Array, linear: LinearFit, group: Index, beats: int) -> tuple[Array, tuple[str, ...]]:
    """Covariance of the coefficients, raised for harmonics that vary between beats by more than noise, and remarks.

    ``group`` [N]: beat of each sample, of ``beats``. If the motion varies from beat to beat, its scatter is at the
    harmonics themselves; stationary noise does not describe this, but the clustered covariance of Liang and Zeger
    (1986) does.
    """
    covariance = linear.covariance
    if beats < 4:
        return covariance, ()
    X = basis(phase, len(covariance) // 2)
    inverse, weighted = np.linalg.inv(products(X, X)), X * linear.residuals[:, None]
    sums = np.stack([inverse @ weighted[group == b].sum(axis=0) for b in range(beats)])
    observed = (sums**2).sum(axis=0) * beats / (beats - 1)
    raised, scale = [], np.ones(len(covariance))
    for k in range(1, len(covariance) // 2 + 1):
        pair = slice(2 * k - 1, 2 * k + 1)
        ratio = float(observed[pair].sum() / np.diag(covariance)[pair].sum())
        free = 2 * (beats - 1)
        if scipy.stats.chi2.sf(ratio * free, free) < _UNLIKELY / (len(covariance) // 2):
            scale[pair] = np.sqrt(ratio)
            raised.append(f"{k} ({np.sqrt(ratio):.1f} times)")
    if not raised:
        return covariance, ()
    remark = f"beats differ by more than noise in harmonic {', '.join(raised)}; the errors are raised accordingly"
    return covariance * np.outer(scale, scale), (remark,)


def _lost(wide: LinearFit, used: int, frequency: float) -> Array:
    """RMS [4] over the beat of the harmonics beyond the first ``used``, for the value and its derivatives.

    The amplitude of each such harmonic is its estimate in the longer series ``wide``, but at least the envelope C k^-q
    of the significant harmonics; beyond the longer series it is the envelope. If there is no envelope, two standard
    errors replace it within the longer series, and zero beyond.
    """
    c, variance = wide.coefficients, np.diag(wide.covariance)
    k = np.arange(1, len(c) // 2 + 1)
    amplitude, error = np.hypot(c[1::2], c[2::2]), np.sqrt((variance[1::2] + variance[2::2]) / 2)
    beyond = np.sqrt(np.maximum(amplitude**2 - 2 * error**2, 0))
    law = _fall_off(k, amplitude, error)
    expected = 2 * error if law is None else law[0] * k ** -law[1]
    bound = np.where(k > used, np.maximum(beyond, expected), 0.0)
    lost = np.zeros(DERIVATIVES + 1)
    for d in range(DERIVATIVES + 1):
        rate = (2 * np.pi * frequency) ** d
        square = float(np.sum((bound * k**d) ** 2))
        if law is not None:
            power = 2 * (law[1] - d)
            square += law[0] ** 2 * float(scipy.special.zeta(power, k[-1] + 1)) if power > 1 else float("inf")
        lost[d] = rate * np.sqrt(square / 2)
    return lost


def _fall_off(k: Index, amplitude: Array, error: Array) -> tuple[float, float] | None:
    """C and q of the envelope C k^-q of significant amplitudes [K] of harmonics k > 1; None with fewer than three.

    q is at least 3: the rate of a wing with mass cannot jump, and a jump of the acceleration decreases as k^-3.
    """
    seen = (k > 1) & (amplitude > _SIGNIFICANT * error)
    if seen.sum() < 3:
        return None
    slope = float(np.polyfit(np.log(k[seen]), np.log(amplitude[seen]), 1)[0])
    q = max(-slope, _LEAST_EXPONENT)
    return float(np.max(amplitude[seen] * k[seen] ** q)), q


def _phases() -> Array:
    return np.arange(_GRID) / _GRID
