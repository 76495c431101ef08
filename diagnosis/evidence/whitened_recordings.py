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
class Stack:
    """Recordings with their noise.

    A stacked vector [D] holds the coefficients of all used channels, recording by recording, channel by channel.

    Attributes:
        recordings: R of them.
        views: each as coefficients of its beat.
        axes: force axes that are compared; of tracks nothing.
        tolerance: root mean square that no model is asked to be better than, m or N.
    """

    recordings: tuple[Recording, ...]
    views: tuple[HarmonicFit, ...]
    axes: tuple[str, ...]
    tolerance: float
    policy: Policy = POLICY

    @classmethod
    def of(cls, recordings: Sequence[Recording], axes: tuple[str, ...] = (), policy: Policy = POLICY) -> Stack:
        """Reduce ``recordings``; ValueError for one that is of no use, or for none."""
        if not recordings:
            raise ValueError("no recording to diagnose: give at least one that is not held out")
        views = tuple(
            harmonic_fit(one, compared(one, axes) if one.kind == "forces" else whole_markers(one)) for one in recordings
        )
        noise = np.sqrt(np.mean(np.concatenate([view.noise[view.used] ** 2 for view in views])))
        largest = max(float(np.nanmax(np.abs(one.values))) for one in recordings)
        return cls(tuple(recordings), views, axes, max(policy.tolerance * float(noise), 1e-6 * largest), policy)

    @cached_property
    def noiseless(self) -> Stack:
        """For coefficients that a simulation made, of which noise has no part."""
        views = tuple(replace(view, variance=np.zeros_like(view.variance)) for view in self.views)
        return replace(self, views=views)

    @cached_property
    def noise(self) -> float:
        """Root mean square of the noise of a sample, m or N; not below the tolerance."""
        square = np.mean(np.concatenate([view.noise[view.used] ** 2 for view in self.views]))
        return max(float(np.sqrt(square)), self.tolerance)

    @cached_property
    def ends(self) -> npt.NDArray[np.int64]:
        """[R], where each recording ends in the stacked vector."""
        return np.asarray(np.cumsum([view.used.sum() * len(view.order) for view in self.views]))

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Each recording's part of the stacked vector."""
        return tuple(slice(a, b) for a, b in zip([0, *self.ends[:-1].tolist()], self.ends.tolist(), strict=True))

    @cached_property
    def variance(self) -> Array:
        """[D] of the noise of each coefficient."""
        return np.concatenate([view.variance[view.used].ravel() for view in self.views])

    @cached_property
    def weight(self) -> Array:
        """[D]: part of a coefficient's square in the mean square over all samples of all channels."""
        channels = sum(int(view.used.sum()) for view in self.views)
        return np.concatenate([np.tile(view.weight, int(view.used.sum())) for view in self.views]) / channels

    @cached_property
    def scale(self) -> Array:
        """[D] by which coefficients are divided: their noise, and what no model is asked to be better than."""
        allowed = [self.tolerance**2 / (len(v.order) * np.tile(v.weight, int(v.used.sum()))) for v in self.views]
        return np.asarray(np.sqrt(self.variance + np.concatenate(allowed)))

    def stacked(self, residuals: Sequence[Array]) -> Array:
        """Coefficients [..., D] of residuals [..., T, C] of each recording."""
        found = [view.of(one)[..., view.used, :] for view, one in zip(self.views, residuals, strict=True)]
        return np.concatenate([one.reshape(*one.shape[:-2], -1) for one in found], axis=-1)

    def chi_squared(self, coefficients: Array) -> float:
        """Sum of squares of whitened coefficients [D]."""
        return float(np.sum((coefficients / self.scale) ** 2))

    @cached_property
    def pieces(self) -> float:
        """Number of independent pieces that what a model misses has: a few for each recording, however long."""
        return min(self.policy.pieces * len(self.recordings), self.policy.most_pieces)

    def surprise(self, coefficients: Array) -> Array:
        """Minus twice the log-likelihood [...] of coefficients [..., D]: noise, and beyond it a misfit of unknown size.

        A misfit far beyond the noise is a model's error, of which ``pieces`` are independent, and not that many samples
        that each know the genes: sums of squares beyond the noise's count by their logarithm.
        """
        beyond = self._beyond(coefficients)
        whole = ((coefficients / self.scale) ** 2).sum(axis=-1)
        return np.asarray(whole - beyond + self.pieces * np.log1p(beyond / self.pieces))

    def trust(self, coefficients: Array) -> float:
        """How much a unit of chi-squared counts beside these coefficients [D]: the slope of :meth:`surprise`."""
        return float(1.0 / (1.0 + self._beyond(coefficients) / self.pieces))

    @cached_property
    def most_trust(self) -> float:
        """The same beside a misfit as large as the tolerance: no fit ends nearer to the best, and no model is exact."""
        return float(1.0 / (1.0 + self.policy.tolerance**2 * len(self.scale) / self.pieces))

    def _beyond(self, coefficients: Array) -> Array:
        return np.asarray(np.maximum(((coefficients / self.scale) ** 2).sum(axis=-1) - len(self.scale), 0.0))

    def excess(self, coefficients: Array) -> float:
        """Mean square beyond the noise of residuals with these coefficients [D], m^2 or N^2; noise may make it < 0."""
        return float(self.weight @ (coefficients**2 - self.variance))

    def excess_of(self, coefficients: Array) -> Array:
        """[R], the same of each recording by itself."""
        every = self.weight * (coefficients**2 - self.variance)
        return np.array([every[part].sum() / self.share[r] for r, part in enumerate(self.parts)])

    @cached_property
    def share(self) -> Array:
        """[R] part of each recording in the mean square."""
        used = np.array([int(view.used.sum()) for view in self.views], float)
        return np.asarray(used / used.sum())

    @cached_property
    def uncertainty(self) -> float:
        """Standard error of :meth:`excess` (m^2 or N^2) by noise alone.

        What noise does to means and trends comes from below the lowest line between harmonics, and is known to a factor
        only; half of it counts. Else markers are independent of each other. Harmonics are not: where beats differ in
        size or timing, all of them do together; so each marker, and a recording of forces as a whole, counts as one
        sample of its noise.
        """
        independent = sum(
            1.0 if recording.kind == "forces" else view.used.sum() / 3.0
            for recording, view in zip(self.recordings, self.views, strict=True)
        )
        every = self.weight * self.variance
        slow = np.concatenate([np.tile((v.order == 0) | v.trend, int(v.used.sum())) for v in self.views])
        return float(every[slow].sum() / 2.0 + np.sqrt(2.0 / independent) * every.sum())

    def evaluate(
        self, problem: Problem, evaluator: Evaluator, values: Array
    ) -> tuple[Array, tuple[str | None, ...], list[Array]]:
        """Coefficients [B, D] of the residuals of ``values`` [B, F], why individuals failed, and the residuals."""
        evaluation = evaluator.evaluate(problem, values, residuals=True)
        residuals = residuals_of(evaluation)
        return self.stacked(residuals), evaluation.reasons, residuals
