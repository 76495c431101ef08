"""Recordings as one whitened vector of Fourier coefficients, and the excess of a residual beyond the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from wingfit.calibration.estimates.linearised import residuals_of
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, compared
from wingfit.diagnosis.policy import POLICY, Policy
from wingfit.inference.noise.harmonic import HarmonicFit, harmonic_fit, whole_markers
from wingfit.records import Recording
from wingfit.records.array_types import Array, Float


@dataclass(frozen=True)
class WhitenedData:
    """Recordings with their noise.

    A coefficient vector [D] holds the coefficients of all used channels, recording by recording, channel by channel.

    Attributes:
        recordings: R of them.
        beat_fits: the harmonic fit of each recording.
        axes: force axes that are compared; empty for tracks.
        tolerance: root mean square (m or N) below which no model is required to be.
    """

    recordings: tuple[Recording, ...]
    beat_fits: tuple[HarmonicFit, ...]
    axes: tuple[str, ...]
    tolerance: float
    policy: Policy = POLICY

    @classmethod
    def of(cls, recordings: Sequence[Recording], axes: tuple[str, ...] = (), policy: Policy = POLICY) -> WhitenedData:
        """Reduce ``recordings`` to coefficients; ValueError for one that cannot be used, or for none."""
        if not recordings:
            raise ValueError("no recording to diagnose: give at least one that is not held out")
        beat_fits = tuple(
            harmonic_fit(one, compared(one, axes) if one.kind == "forces" else whole_markers(one)) for one in recordings
        )
        noise = np.sqrt(np.mean(np.concatenate([fit.noise[fit.used] ** 2 for fit in beat_fits])))
        largest = max(float(np.nanmax(np.abs(one.values))) for one in recordings)
        return cls(tuple(recordings), beat_fits, axes, max(policy.tolerance * float(noise), 1e-6 * largest), policy)

    @cached_property
    def noiseless(self) -> WhitenedData:
        """The same with zero noise variance, for coefficients that were simulated."""
        beat_fits = tuple(replace(fit, variance=np.zeros_like(fit.variance)) for fit in self.beat_fits)
        return replace(self, beat_fits=beat_fits)

    @cached_property
    def noise(self) -> float:
        """Root mean square of the noise of a sample, m or N; not below the tolerance."""
        square = np.mean(np.concatenate([fit.noise[fit.used] ** 2 for fit in self.beat_fits]))
        return max(float(np.sqrt(square)), self.tolerance)

    @cached_property
    def recording_slices(self) -> tuple[slice, ...]:
        """Slice of each recording in the coefficient vector."""
        ends = np.cumsum([0, *(fit.used.sum() * len(fit.order) for fit in self.beat_fits)]).tolist()
        return tuple(slice(a, b) for a, b in pairwise(ends))

    @cached_property
    def variance(self) -> Float[Array, " D"]:
        """[D] noise variance of the coefficients."""
        return np.concatenate([fit.variance[fit.used].ravel() for fit in self.beat_fits])

    @cached_property
    def weight(self) -> Float[Array, " D"]:
        """[D] weight of a coefficient's square in the mean square over all samples of all channels."""
        channels = sum(int(fit.used.sum()) for fit in self.beat_fits)
        return np.concatenate([np.tile(fit.weight, int(fit.used.sum())) for fit in self.beat_fits]) / channels

    @cached_property
    def scale(self) -> Float[Array, " D"]:
        """[D] standard deviation of the coefficients by noise and tolerance together; whitening divides by it."""
        allowed = [self.tolerance**2 / (len(v.order) * np.tile(v.weight, int(v.used.sum()))) for v in self.beat_fits]
        return np.asarray(np.sqrt(self.variance + np.concatenate(allowed)))

    def coefficients_of(self, residuals: Sequence[Float[Array, "*B _ _"]]) -> Float[Array, "*B D"]:
        """Coefficients [..., D] of the residuals [..., T, C] of each recording."""
        found = [fit.of(one)[..., fit.used, :] for fit, one in zip(self.beat_fits, residuals, strict=True)]
        return np.concatenate([one.reshape(*one.shape[:-2], -1) for one in found], axis=-1)

    def chi_squared(self, coefficients: Float[Array, " D"]) -> float:
        """Sum of squares of whitened coefficients [D]."""
        return float(np.sum((coefficients / self.scale) ** 2))

    @cached_property
    def effective_samples(self) -> float:
        """Number of independent samples of a model's error: a few for each recording, however long it is."""
        return min(self.policy.effective_samples * len(self.recordings), self.policy.max_effective_samples)

    def deviance(self, coefficients: Float[Array, "*B D"]) -> Float[Array, "*B"]:
        """Minus twice the log-likelihood [...] of residual coefficients [..., D], for noise plus a model error.

        The chi-squared beyond its expectation D is attributed to an error of the model. Of this error only
        ``effective_samples`` are independent, and its size is unknown, so its logarithm counts (as in Student's t).
        """
        beyond = self._chi_squared_excess(coefficients)
        whole = ((coefficients / self.scale) ** 2).sum(axis=-1)
        return np.asarray(whole - beyond + self.effective_samples * np.log1p(beyond / self.effective_samples))

    def likelihood_weight(self, coefficients: Float[Array, " D"]) -> float:
        """Slope of :meth:`deviance` with chi-squared at coefficients [D], as in iteratively reweighted fits."""
        return float(1.0 / (1.0 + self._chi_squared_excess(coefficients) / self.effective_samples))

    @cached_property
    def max_likelihood_weight(self) -> float:
        """The weight at a model error as large as the tolerance; no model is taken to be more exact."""
        return float(1.0 / (1.0 + self.policy.tolerance**2 * len(self.scale) / self.effective_samples))

    def _chi_squared_excess(self, coefficients: Array) -> Array:
        return np.asarray(np.maximum(((coefficients / self.scale) ** 2).sum(axis=-1) - len(self.scale), 0.0))

    def excess(self, coefficients: Float[Array, " D"]) -> float:
        """Mean square beyond the noise of residuals with coefficients [D], m^2 or N^2; noise may make it negative."""
        return float(self.weight @ (coefficients**2 - self.variance))

    def excess_by_recording(self, coefficients: Float[Array, " D"]) -> Float[Array, " R"]:
        """Excess [R] of each recording."""
        every = self.weight * (coefficients**2 - self.variance)
        return np.array([every[part].sum() / self.recording_weights[r] for r, part in enumerate(self.recording_slices)])

    @cached_property
    def recording_weights(self) -> Float[Array, " R"]:
        """[R] weight of each recording in the mean square."""
        used = np.array([int(fit.used.sum()) for fit in self.beat_fits], float)
        return np.asarray(used / used.sum())

    @cached_property
    def excess_standard_error(self) -> float:
        """Standard error of :meth:`excess` (m^2 or N^2) by noise alone.

        The noise of means and trends lies below the lowest line between harmonics and is known up to a factor only;
        half of it counts. Markers are independent of each other. Harmonics are not, since beats differ in size or
        timing as a whole; so each marker, and a recording of forces as a whole, counts as one sample of its noise.
        """
        independent = sum(
            1.0 if recording.kind == "forces" else fit.used.sum() / 3.0
            for recording, fit in zip(self.recordings, self.beat_fits, strict=True)
        )
        every = self.weight * self.variance
        slow = np.concatenate([np.tile((v.order == 0) | v.trend, int(v.used.sum())) for v in self.beat_fits])
        return float(every[slow].sum() / 2.0 + np.sqrt(2.0 / independent) * every.sum())

    def evaluate(
        self, problem: Problem, evaluator: Evaluator, values: Float[Array, "B F"]
    ) -> tuple[Float[Array, "B D"], tuple[str | None, ...], list[Array]]:
        """Coefficients [B, D] of the residuals of ``values`` [B, F], reasons of failed individuals, and residuals."""
        evaluation = evaluator.evaluate(problem, values, residuals=True)
        residuals = residuals_of(evaluation)
        return self.coefficients_of(residuals), evaluation.reasons, residuals
