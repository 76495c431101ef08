"""Recordings stacked into one vector of coefficients, whitened, and the misfit that is left beyond the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wingfit.calibration.estimates.linearised import residuals_of
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, compared
from wingfit.diagnosis.policy import POLICY, Policy
from wingfit.inference.noise.harmonic import HarmonicFit, harmonic_fit, whole_markers
from wingfit.records import Recording

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class WhitenedData:
    """Recordings with their noise.

    A stacked vector [D] holds the coefficients of all used channels, recording by recording, channel by channel.

    Attributes:
        recordings: R of them.
        views: each as coefficients of its beat.
        axes: force axes that are compared; of tracks nothing.
        tolerance: root mean square that no model is asked to be better than, m or N.
    """

    recordings: tuple[Recording, ...]
    beat_fits: tuple[HarmonicFit, ...]
    axes: tuple[str, ...]
    tolerance: float
    policy: Policy = POLICY

    @classmethod
    def of(cls, recordings: Sequence[Recording], axes: tuple[str, ...] = (), policy: Policy = POLICY) -> WhitenedData:
        """Reduce ``recordings``; ValueError for one that is of no use, or for none."""
        if not recordings:
            raise ValueError("no recording to diagnose: give at least one that is not held out")
        beat_fits = tuple(
            harmonic_fit(one, compared(one, axes) if one.kind == "forces" else whole_markers(one)) for one in recordings
        )
        noise = np.sqrt(np.mean(np.concatenate([beat_fit.noise[beat_fit.used] ** 2 for beat_fit in beat_fits])))
        largest = max(float(np.nanmax(np.abs(one.values))) for one in recordings)
        return cls(tuple(recordings), beat_fits, axes, max(policy.tolerance * float(noise), 1e-6 * largest), policy)

    @cached_property
    def noiseless(self) -> WhitenedData:
        """For coefficients that a simulation made, of which noise has no part."""
        beat_fits = tuple(replace(beat_fit, variance=np.zeros_like(beat_fit.variance)) for beat_fit in self.beat_fits)
        return replace(self, beat_fits=beat_fits)

    @cached_property
    def noise(self) -> float:
        """Root mean square of the noise of a sample, m or N; not below the tolerance."""
        square = np.mean(np.concatenate([beat_fit.noise[beat_fit.used] ** 2 for beat_fit in self.beat_fits]))
        return max(float(np.sqrt(square)), self.tolerance)

    @cached_property
    def recording_ends(self) -> npt.NDArray[np.int64]:
        """[R], where each recording ends in the stacked vector."""
        return np.asarray(np.cumsum([beat_fit.used.sum() * len(beat_fit.order) for beat_fit in self.beat_fits]))

    @cached_property
    def recording_slices(self) -> tuple[slice, ...]:
        """Each recording's part of the stacked vector."""
        return tuple(
            slice(a, b)
            for a, b in zip([0, *self.recording_ends[:-1].tolist()], self.recording_ends.tolist(), strict=True)
        )

    @cached_property
    def variance(self) -> Array:
        """[D] of the noise of each coefficient."""
        return np.concatenate([beat_fit.variance[beat_fit.used].ravel() for beat_fit in self.beat_fits])

    @cached_property
    def weight(self) -> Array:
        """[D]: part of a coefficient's square in the mean square over all samples of all channels."""
        channels = sum(int(beat_fit.used.sum()) for beat_fit in self.beat_fits)
        return (
            np.concatenate([np.tile(beat_fit.weight, int(beat_fit.used.sum())) for beat_fit in self.beat_fits])
            / channels
        )

    @cached_property
    def scale(self) -> Array:
        """[D] by which coefficients are divided: their noise, and what no model is asked to be better than."""
        allowed = [self.tolerance**2 / (len(v.order) * np.tile(v.weight, int(v.used.sum()))) for v in self.beat_fits]
        return np.asarray(np.sqrt(self.variance + np.concatenate(allowed)))

    def coefficients_of(self, residuals: Sequence[Array]) -> Array:
        """Coefficients [..., D] of residuals [..., T, C] of each recording."""
        found = [
            beat_fit.of(one)[..., beat_fit.used, :] for beat_fit, one in zip(self.beat_fits, residuals, strict=True)
        ]
        return np.concatenate([one.reshape(*one.shape[:-2], -1) for one in found], axis=-1)

    def chi_squared(self, coefficients: Array) -> float:
        """Sum of squares of whitened coefficients [D]."""
        return float(np.sum((coefficients / self.scale) ** 2))

    @cached_property
    def effective_samples(self) -> float:
        """Number of independent pieces that what a model misses has: a few for each recording, however long."""
        return min(self.policy.effective_samples * len(self.recordings), self.policy.max_effective_samples)

    def deviance(self, coefficients: Array) -> Array:
        """Minus twice the log-likelihood [...] of coefficients [..., D]: noise, and beyond it a misfit of unknown size.

        A misfit far beyond the noise is a model's error, of which ``pieces`` are independent, and not that many samples
        that each know the genes: sums of squares beyond the noise's count by their logarithm.
        """
        beyond = self._chi_squared_excess(coefficients)
        whole = ((coefficients / self.scale) ** 2).sum(axis=-1)
        return np.asarray(whole - beyond + self.effective_samples * np.log1p(beyond / self.effective_samples))

    def likelihood_weight(self, coefficients: Array) -> float:
        """How much a unit of chi-squared counts beside these coefficients [D]: the slope of :meth:`surprise`."""
        return float(1.0 / (1.0 + self._chi_squared_excess(coefficients) / self.effective_samples))

    @cached_property
    def max_likelihood_weight(self) -> float:
        """The same beside a misfit as large as the tolerance: no fit ends nearer to the best, and no model is exact."""
        return float(1.0 / (1.0 + self.policy.tolerance**2 * len(self.scale) / self.effective_samples))

    def _chi_squared_excess(self, coefficients: Array) -> Array:
        return np.asarray(np.maximum(((coefficients / self.scale) ** 2).sum(axis=-1) - len(self.scale), 0.0))

    def excess(self, coefficients: Array) -> float:
        """Mean square beyond the noise of residuals with these coefficients [D], m^2 or N^2; noise may make it < 0."""
        return float(self.weight @ (coefficients**2 - self.variance))

    def excess_by_recording(self, coefficients: Array) -> Array:
        """[R], the same of each recording by itself."""
        every = self.weight * (coefficients**2 - self.variance)
        return np.array([every[part].sum() / self.recording_weights[r] for r, part in enumerate(self.recording_slices)])

    @cached_property
    def recording_weights(self) -> Array:
        """[R] part of each recording in the mean square."""
        used = np.array([int(beat_fit.used.sum()) for beat_fit in self.beat_fits], float)
        return np.asarray(used / used.sum())

    @cached_property
    def excess_standard_error(self) -> float:
        """Standard error of :meth:`excess` (m^2 or N^2) by noise alone.

        What noise does to means and trends comes from below the lowest line between harmonics, and is known to a factor
        only; half of it counts. Else markers are independent of each other. Harmonics are not: where beats differ in
        size or timing, all of them do together; so each marker, and a recording of forces as a whole, counts as one
        sample of its noise.
        """
        independent = sum(
            1.0 if recording.kind == "forces" else beat_fit.used.sum() / 3.0
            for recording, beat_fit in zip(self.recordings, self.beat_fits, strict=True)
        )
        every = self.weight * self.variance
        slow = np.concatenate([np.tile((v.order == 0) | v.trend, int(v.used.sum())) for v in self.beat_fits])
        return float(every[slow].sum() / 2.0 + np.sqrt(2.0 / independent) * every.sum())

    def evaluate(
        self, problem: Problem, evaluator: Evaluator, values: Array
    ) -> tuple[Array, tuple[str | None, ...], list[Array]]:
        """Coefficients [B, D] of the residuals of ``values`` [B, F], why individuals failed, and the residuals."""
        evaluation = evaluator.evaluate(problem, values, residuals=True)
        residuals = residuals_of(evaluation)
        return self.coefficients_of(residuals), evaluation.reasons, residuals
