"""A periodic motion as a Fourier series, with the error of its value and of its derivatives.

Two errors are kept apart: the noise that the series lets through, and the motion that it cuts off. More harmonics trade
the second for the first, the more so the higher the derivative (noise of the d-th derivative grows as k^d).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import special, stats

from wingfit.records.array_types import Array, Index
from wingfit.records.blas_threads import one_blas_thread
from wingfit.tracking.noise import LinearFit, Noise, least_squares, products

DERIVATIVES = 3
MOST_HARMONICS = 30
_GRID = 360
_SEEN = 3.0
"""An amplitude this many standard errors large is taken for motion."""
_UNLIKELY = 0.01
_SLOWEST = 3.0
_FOLDS = 10
_UNDETERMINED = 1e8


@dataclass(frozen=True, eq=False)
class PeriodicFit:
    """mean + sum_k [cosine_k cos(2 pi k t*) + sine_k sin(2 pi k t*)], t* = frequency (t - start).

    Attributes:
        frequency: of the beat, Hz; ``start``: a time at which t* = 0, s.
        coefficients: [1 + 2 K] mean, cosine_1, sine_1, cosine_2, ...; ``covariance`` theirs, of coloured noise.
        noise: of one sample.
        lost: [4] RMS over the beat of what harmonics beyond K may hold, of value and derivatives (unit / s^d); infinite
            where the harmonics fall off too slowly for the derivative to exist in the mean square.
        scores: [K_max] RMS of prediction of samples left out, by number of harmonics from 1; empty where K was given.
        beats: number of beats with samples; ``samples`` their number.
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
        """Number K of harmonics; the series passes up to K times the frequency and nothing beyond."""
        return len(self.coefficients) // 2

    @one_blas_thread
    def at(self, phase: Array, derivative: int = 0) -> Array:
        """Value, or a derivative in time (unit / s^d), at ``phase`` t* [...]."""
        return basis(phase, self.harmonics, derivative, self.frequency) @ self.coefficients

    @one_blas_thread
    def error_at(self, phase: Array, derivative: int = 0) -> Array:
        """Standard error of :meth:`at` from noise alone; see ``lost`` for what is cut off."""
        B = basis(phase, self.harmonics, derivative, self.frequency)
        return np.asarray(np.sqrt(np.einsum("...i,ij,...j->...", B, self.covariance, B)))

    @property
    def passed(self) -> Array:
        """[4] RMS over the beat of the noise in value and derivatives."""
        return np.array([_rms(self.error_at(_phases(), d)) for d in range(DERIVATIVES + 1)])

    @property
    def error(self) -> Array:
        """[4] RMS over the beat of noise and cut-off together."""
        return np.hypot(self.passed, self.lost)

    @property
    def amplitude(self) -> Array:
        """[4] RMS over the beat of the signal itself about its mean."""
        return np.array([float(np.std(self.at(_phases(), d))) for d in range(DERIVATIVES + 1)])

    @property
    def series(self) -> tuple[float, tuple[float, ...], tuple[float, ...]]:
        """Mean, cosine and sine coefficients as :class:`wingfit.records.FourierFlap` takes them."""
        c = self.coefficients
        return float(c[0]), tuple(c[1::2].tolist()), tuple(c[2::2].tolist())

    def shifted(self, phase: float) -> PeriodicFit:
        """The same motion with t* = 0 moved to the present ``phase``."""
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
    """Fit a periodic series to samples of several beats.

    ``times`` [N] in s increase, evenly or not; NaN in ``values`` [N] is a gap. Without ``harmonics`` their number is
    that which best predicts beats left out of the fit (Stone 1974, cross-validation); with fewer than three beats
    single samples are left out instead, and correlated noise may then pass for motion. ValueError where the samples
    cannot carry a series.
    """
    seen = np.isfinite(values)
    times, values = times[seen], values[seen]
    phase = (times - start) * frequency
    most = _most_harmonics(phase)
    if harmonics is not None and not 1 <= harmonics <= most:
        raise ValueError(
            f"{harmonics} harmonics; {len(values)} samples with these gaps in phase carry 1 to {most}: "
            "ask for fewer, or give more samples"
        )
    beats, group = np.unique(np.floor(phase - phase[0]), return_inverse=True)
    groups = group if len(beats) >= 3 else np.arange(len(values)) % _FOLDS
    scores = () if harmonics else _predictions(phase, values, groups, most)
    chosen = harmonics or 1 + int(np.argmin(scores))
    # The noise is that about a wider series, so that motion which is cut off does not count as noise.
    wide = least_squares(times, basis(phase, min(2 * chosen + 2, most)), values)
    linear = least_squares(times, basis(phase, chosen), values, wide.noise)
    covariance, remarks = _between_beats(phase, linear, group, len(beats))
    if len(beats) < 3 and not harmonics:
        remarks += (f"{len(beats)} beat(s) only: slow noise cannot be told from motion; record three beats or more",)
    return PeriodicFit(
        frequency,
        start,
        linear.coefficients,
        covariance,
        linear.noise,
        _lost(wide, chosen, frequency),
        scores,
        len(beats),
        len(values),
        remarks,
    )


def basis(phase: Array, harmonics: int, derivative: int = 0, frequency: float = 1.0) -> Array:
    """Columns [..., 1 + 2 K] of the series at ``phase``, or of a derivative in time."""
    k = np.arange(1, harmonics + 1)
    angle = 2 * np.pi * np.multiply.outer(phase, k)
    factor = (2 * np.pi * frequency * k) ** derivative
    columns = np.zeros((*np.shape(phase), 1 + 2 * harmonics))
    columns[..., 0] = float(derivative == 0)
    columns[..., 1::2] = factor * np.cos(angle + derivative * np.pi / 2)
    columns[..., 2::2] = factor * np.sin(angle + derivative * np.pi / 2)
    return columns


def _turn(harmonics: int, phase: float) -> Array:
    turn = np.eye(1 + 2 * harmonics)
    for k in range(1, harmonics + 1):
        c, s = np.cos(2 * np.pi * k * phase), np.sin(2 * np.pi * k * phase)
        turn[2 * k - 1 : 2 * k + 1, 2 * k - 1 : 2 * k + 1] = [[c, s], [-s, c]]
    return turn


def _most_harmonics(phase: Array) -> int:
    """What the samples carry: three samples a coefficient, and no gap in phase longer than half a wavelength."""
    folded = np.sort(phase % 1.0)
    gap = float(np.max(np.diff(np.append(folded, folded[0] + 1)))) if len(folded) else 1.0
    most = min(MOST_HARMONICS, (len(folded) // 3 - 1) // 2, int(0.5 / gap - 1e-6))
    if most < 1:
        raise ValueError(
            f"{len(folded)} samples with the largest gap {gap:.2f} of a beat; a series needs at least 9 samples and "
            "no gap above half a beat: give more samples or beats"
        )
    return most


def _predictions(phase: Array, values: Array, groups: Index, most: int) -> tuple[float, ...]:
    """RMS error of predicting each group from the others, for 1 to ``most`` harmonics."""
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
    """Covariance of the coefficients, raised per harmonic where beats differ by more than the noise explains.

    Wings that do not repeat themselves give scatter at the very harmonics, which stationary noise misses; the scatter
    between beats (the clustered covariance of Liang and Zeger 1986) shows it.
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
        if stats.chi2.sf(ratio * free, free) < _UNLIKELY / (len(covariance) // 2):
            scale[pair] = np.sqrt(ratio)
            raised.append(f"{k} ({np.sqrt(ratio):.1f} times)")
    if not raised:
        return covariance, ()
    remark = f"beats differ by more than noise in harmonic {', '.join(raised)}; the errors are raised accordingly"
    return covariance * np.outer(scale, scale), (remark,)


def _lost(wide: LinearFit, kept: int, frequency: float) -> Array:
    """RMS over the beat of what lies beyond ``kept`` harmonics, for value and derivatives.

    Each harmonic beyond holds what a wider series finds in it, and at least what the fall-off k^-q of the harmonics
    seen lets expect (their envelope); beyond the wider series the envelope alone counts.
    """
    c, variance = wide.coefficients, np.diag(wide.covariance)
    k = np.arange(1, len(c) // 2 + 1)
    amplitude, error = np.hypot(c[1::2], c[2::2]), np.sqrt((variance[1::2] + variance[2::2]) / 2)
    beyond = np.sqrt(np.maximum(amplitude**2 - 2 * error**2, 0))
    law = _fall_off(k, amplitude, error)
    expected = 2 * error if law is None else law[0] * k ** -law[1]
    bound = np.where(k > kept, np.maximum(beyond, expected), 0.0)
    lost = np.zeros(DERIVATIVES + 1)
    for d in range(DERIVATIVES + 1):
        rate = (2 * np.pi * frequency) ** d
        square = float(np.sum((bound * k**d) ** 2))
        if law is not None:
            power = 2 * (law[1] - d)
            square += law[0] ** 2 * float(special.zeta(power, k[-1] + 1)) if power > 1 else float("inf")
        lost[d] = rate * np.sqrt(square / 2)
    return lost


def _fall_off(k: Index, amplitude: Array, error: Array) -> tuple[float, float] | None:
    """Envelope C k^-q of the harmonics seen beyond the first; None with fewer than three of them.

    q is at least 3: the rate of a wing with mass cannot jump, and a jump of the acceleration falls off as k^-3.
    """
    seen = (k > 1) & (amplitude > _SEEN * error)
    if seen.sum() < 3:
        return None
    slope = float(np.polyfit(np.log(k[seen]), np.log(amplitude[seen]), 1)[0])
    q = max(-slope, _SLOWEST)
    return float(np.max(amplitude[seen] * k[seen] ** q)), q


def _phases() -> Array:
    return np.arange(_GRID) / _GRID


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
