"""Reduce recordings to one vector of Fourier coefficients with known noise, and measure residuals beyond that noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from wingfit.calibration.estimates.linearised import residuals_of
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, compared
from wingfit.diagnosis.evidence.whitening import Whitening
from wingfit.diagnosis.policy import POLICY, Policy
from wingfit.inference.marginal import Marginal
from wingfit.inference.noise.harmonic import HarmonicFit, harmonic_fit, whole_markers
from wingfit.inference.noise.series import MEASURED_ERROR
from wingfit.inference.noise.series_fit import SeriesFit, SeriesReduction
from wingfit.records import AnyRecording, Recording, Series
from wingfit.records.array_types import Array, Float
from wingfit.records.dataset import AnyKind

Reduced = HarmonicFit | SeriesFit
SMALLEST_TOLERANCE = 1e-6  # of the largest coordinate


def _reduced(recording: AnyRecording, axes: tuple[str, ...], series: SeriesReduction | None) -> Reduced:
    if isinstance(recording, Recording):
        return harmonic_fit(
            recording, compared(recording, axes) if recording.kind == "forces" else whole_markers(recording)
        )
    if series is None:
        raise TypeError(f"recording {recording.name!r} has no beat; its noise must be given")
    return series(recording)


@dataclass(frozen=True)
class WhitenedData:
    """Recordings, reduced to Fourier coefficients of the beat, with the noise of these.

    A coefficient vector [D], of recordings or of residuals, holds the coefficients (m or N) of all used channels,
    recording by recording, channel by channel. Used are channels with enough samples.

    Attributes:
        recordings: R of them.
        reduced: for each recording, the linear map from samples to coefficients, and their noise.
        axes: force axes that are compared; empty for tracks and series.
        tolerance: root mean square (m or N) that any model may differ from the truth.
        policy: thresholds.
        series: reduces recordings without a beat, with their noise; None for tracks and forces.
        errors: of the description, integrated out of the coefficients of every residual; None: none were found.
        rigid_errors: [D, K] changes of the coefficients by one standard deviation of each of K errors that are not
            integrated out, because they look like faults: genes adapt to them, so that they are part of the intervals.
        is_steady: of series: whether the residual of the nominal model may be slow noise. If not, because its power
            differs as that of no stationary noise does, the noise is what is visible of it.
    """

    recordings: tuple[AnyRecording, ...]
    reduced: tuple[Reduced, ...]
    axes: tuple[str, ...]
    tolerance: float
    policy: Policy = POLICY
    series: SeriesReduction | None = None
    errors: Marginal | None = None
    rigid_errors: Float[Array, "D K"] | None = None
    is_steady: bool = True

    @classmethod
    def of(
        cls,
        recordings: Sequence[AnyRecording],
        axes: tuple[str, ...] = (),
        policy: Policy = POLICY,
        series: SeriesReduction | None = None,
    ) -> WhitenedData:
        """Reduce ``recordings`` (of forces: ``axes``) to coefficients; ValueError for an unusable one, or none.

        ``series`` reduces recordings without a beat; None: none of the ``recordings`` is such a series.
        """
        if not recordings:
            raise ValueError("no recording to diagnose: give at least one that is not held out")
        reduced = tuple(_reduced(one, axes, series) for one in recordings)
        noise = np.sqrt(np.mean(np.concatenate([fit.noise[fit.used] ** 2 for fit in reduced])))
        largest = 0.0 if series else max(float(np.nanmax(np.abs(one.values))) for one in recordings)
        least = policy.solver_error if recordings[0].kind == "forces" else SMALLEST_TOLERANCE
        tolerance = max(policy.tolerance * float(noise), least * largest)
        return cls(tuple(recordings), reduced, axes, tolerance, policy, series)

    def like(self, recordings: Sequence[AnyRecording]) -> WhitenedData:
        """Reduce other ``recordings`` of the same dataset in the same way."""
        return replace(WhitenedData.of(recordings, self.axes, self.policy, self.series), is_steady=self.is_steady)

    @property
    def kind(self) -> AnyKind:
        """What the recordings hold: "tracks", "forces" or "series"."""
        return self.recordings[0].kind

    @property
    def unit(self) -> str:
        """Unit of coefficients: "m" of tracks, "N" of forces; of series "noise", as channels have different units."""
        return {"tracks": "m", "forces": "N", "series": "noise"}[self.kind]

    @cached_property
    def beat_fits(self) -> tuple[HarmonicFit, ...]:
        """Return ``reduced`` of recordings with a beat; TypeError for others."""
        if not all(isinstance(one, HarmonicFit) for one in self.reduced):
            raise TypeError("recordings without a beat have no harmonics")
        return tuple(one for one in self.reduced if isinstance(one, HarmonicFit))

    @cached_property
    def beat_recordings(self) -> tuple[Recording, ...]:
        """Return ``recordings`` of a wing or vehicle; TypeError for others."""
        if not all(isinstance(one, Recording) for one in self.recordings):
            raise TypeError("a recording of another rig has no beat")
        return tuple(one for one in self.recordings if isinstance(one, Recording))

    @cached_property
    def noiseless(self) -> WhitenedData:
        """The same with zero noise variance, for coefficients that come from simulations alone."""
        reduced = tuple(replace(fit, variance=np.zeros_like(fit.variance)) for fit in self.reduced)
        return replace(self, reduced=reduced, errors=None, rigid_errors=None)

    def allowing(self, errors: Marginal, rigid: Float[Array, "D K"]) -> WhitenedData:
        """Return the same data with ``errors`` of the description, relative to the noise, integrated out.

        ``rigid`` [D, K]: changes of the coefficients by one standard deviation of each error that is not.
        """
        allowing = replace(self, errors=errors)
        return replace(allowing, rigid_errors=allowing.without_errors(rigid.T).T)

    @cached_property
    def noise(self) -> float:
        """Root mean square of the noise of a sample over all used channels, m or N; at least the tolerance."""
        square = np.mean(np.concatenate([fit.noise[fit.used] ** 2 for fit in self.reduced]))
        return max(float(np.sqrt(square)), self.tolerance)

    @cached_property
    def accepted(self) -> float:
        """Root mean square (of series: in scales) by which the user lets any model differ from the truth; 0 if none.

        In the measure of an :meth:`excess`; :attr:`accepted_of_samples` is that of the samples.
        """
        return float(np.sqrt(np.mean(np.concatenate([share * one for share, one in self._accepted_squares]))))

    @cached_property
    def accepted_of_samples(self) -> float:
        """The same as :attr:`accepted`, root mean square over the samples."""
        return float(np.sqrt(np.mean(np.concatenate([one for _, one in self._accepted_squares]))))

    @cached_property
    def _accepted_squares(self) -> list[tuple[float, Array]]:
        """Of each recording, samples by coefficients, and the squares of the accepted errors, in scales."""
        squares = list[tuple[float, Array]]()
        for one, fit in zip(self.recordings, self.reduced, strict=True):
            if isinstance(one, Series) and isinstance(fit, SeriesFit):
                errors = np.array([channel.accepted_error or 0.0 for channel in one.quantities])[fit.used]
                whole = len(one.times) / len(fit.weight)  # a model's error lies in the coefficients, fewer than samples
                squares.append((whole, (errors / fit.scale[fit.used]) ** 2))
        return squares or [(1.0, np.zeros(1))]

    @cached_property
    def noise_of_recordings(self) -> Float[Array, " R"]:
        """Noise of each recording with a beat [R]: root mean square of a sample over its used channels, m or N."""
        return np.array([float(np.sqrt(np.mean(fit.noise[fit.used] ** 2))) for fit in self.beat_fits])

    @cached_property
    def uncertainty_of_beats(self) -> Float[Array, " R"]:
        """Standard error of each recording's mean beat [R], divided by that beat; RMS without mean values."""
        found = list[float]()
        for fit in self.beat_fits:
            moving = (fit.order >= 1) & ~fit.trend
            size = float((fit.coefficients[fit.used][:, moving] ** 2 * fit.weight[moving]).sum())
            error = float((fit.variance[fit.used][:, moving] * fit.weight[moving]).sum())
            found.append(np.sqrt(error / size) if size > 0.0 else np.inf)
        return np.array(found)

    @cached_property
    def drift(self) -> Float[Array, " R"]:
        """Change of the beat in each recording [R] that noise does not explain, divided by its noise of a sample.

        Both are root mean squares over the recording's used channels; zero where noise explains the change. It is a
        slow change; where the markers share a part of the noise that is not small, that part counts as a change too.
        """
        if self.kind == "series":
            return np.zeros(len(self.recordings))
        noise = self.noise_of_recordings
        slow = [fit.drift.size if fit.drift else 0.0 for fit in self.beat_fits]
        found = np.maximum(
            slow,
            [
                np.sqrt(fit.shared) * one * (fit.shared > self.policy.shared)
                for fit, one in zip(self.beat_fits, noise, strict=True)
            ],
        )
        return np.asarray(found / np.maximum(noise, self.tolerance))

    @cached_property
    def modulation(self) -> Float[Array, " R"]:
        """Periodic change of the beat in each recording [R], as of :meth:`drift`."""
        if self.kind == "series":
            return np.zeros(len(self.recordings))
        found = [fit.modulation.size if fit.modulation else 0.0 for fit in self.beat_fits]
        return np.asarray(found / np.maximum(self.noise_of_recordings, self.tolerance))

    def change_of_beat(self, coefficients: Float[Array, " D"]) -> float:
        """Return the mean square beyond noise (m^2 or N^2) of a residual's linear change of mean and first harmonic.

        Of each recording, only those of the two count that drift. ``coefficients`` [D]: of the residual.
        """
        parts = []
        for fit in self.beat_fits:
            beat, mean = (fit.drift.beat.found, fit.drift.mean.found) if fit.drift else (False, False)
            parts.append(np.tile(fit.trend & np.where(fit.order > 0, beat, mean), int(fit.used.sum())))
        seen = np.concatenate(parts)
        return max(float(self.weight[seen] @ (coefficients[seen] ** 2 - self.variance[seen])), 0.0)

    def mean_beat_excess(self, coefficients: Float[Array, " D"]) -> float:
        """Return the :meth:`excess` (m^2 or N^2) of a residual's ``coefficients`` [D] without those of slow trends."""
        steady = ~np.concatenate([np.tile(v.trend, int(v.used.sum())) for v in self.beat_fits])
        return float(self.weight[steady] @ (coefficients[steady] ** 2 - self.variance[steady]))

    @cached_property
    def recording_slices(self) -> tuple[slice, ...]:
        """Where the coefficients of each recording are in a coefficient vector [D]."""
        ends = np.cumsum([0, *(fit.used.sum() * len(fit.weight) for fit in self.reduced)]).tolist()
        return tuple(slice(a, b) for a, b in pairwise(ends))

    @cached_property
    def variance(self) -> Float[Array, " D"]:
        """Noise variance [D] of the coefficients, m^2 or N^2."""
        return np.concatenate([fit.variance[fit.used].ravel() for fit in self.reduced])

    @cached_property
    def weight(self) -> Float[Array, " D"]:
        """Weights [D]: the sum of weight times squared coefficient is the mean square over all samples and channels."""
        channels = sum(int(fit.used.sum()) for fit in self.reduced)
        return np.concatenate([np.tile(fit.weight, int(fit.used.sum())) for fit in self.reduced]) / channels

    @cached_property
    def scale(self) -> Float[Array, " D"]:
        """Standard deviation [D] of each coefficient by noise and tolerance together."""
        allowed = [self.tolerance**2 / (len(v.weight) * np.tile(v.weight, int(v.used.sum()))) for v in self.reduced]
        return np.asarray(np.sqrt(self.variance + np.concatenate(allowed)))

    @cached_property
    def whitening(self) -> Whitening:
        """The map that gives noise and tolerance of coefficients unit covariance."""
        return Whitening.of(self.scale, self.reduced, self.recording_slices)

    def whiten(self, coefficients: Float[Array, "*B D"]) -> Float[Array, "*B D"]:
        """Return ``coefficients`` [..., D] relative to their noise (:class:`Whitening`)."""
        return self.whitening.whiten(coefficients)

    def whitened_slopes(self, jacobian: Float[Array, "D F"]) -> Float[Array, "D F"]:
        """Return the derivatives [D, F] of whitened coefficients, from those of the coefficients."""
        return self.whiten(jacobian.T).T

    def coefficients_of(self, residuals: Sequence[Float[Array, "*B _ _"]]) -> Float[Array, "*B D"]:
        """Return the coefficients [..., D] of ``residuals``: for each recording [..., T, C], C channels at T times.

        Without what errors of the description contribute.
        """
        found = [fit.of(one)[..., fit.used, :] for fit, one in zip(self.reduced, residuals, strict=True)]
        return self.without_errors(np.concatenate([one.reshape(*one.shape[:-2], -1) for one in found], axis=-1))

    def without_errors(self, coefficients: Float[Array, "*B D"]) -> Float[Array, "*B D"]:
        """Return ``coefficients`` [..., D] without what errors of the description contribute, or could explain."""
        if self.errors is None:
            return coefficients
        return self.whitening.restore(self.errors.whiten(self.whiten(coefficients)))

    def chi_squared(self, coefficients: Float[Array, " D"]) -> float:
        """Return the sum of squares of the whitened ``coefficients`` [D]."""
        return float(np.sum(self.whiten(coefficients) ** 2))

    @cached_property
    def experiments(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the recordings of each experiment: repeats of a series belong together, others are single."""
        groups: dict[str, list[int]] = {}
        for r, one in enumerate(self.recordings):
            repeats = one.repeats if isinstance(one, Series) else ""
            groups.setdefault(f"repeats {repeats}" if repeats else f"recording {r}", []).append(r)
        return tuple(tuple(group) for group in groups.values())

    @cached_property
    def effective_samples(self) -> float:
        """Number of independent samples of a model's error: a few for each recording, however long it is."""
        most = self.policy.effective_samples
        own = [min(fit.features, most) if isinstance(fit, SeriesFit) else most for fit in self.reduced]
        every = [max(own[r] for r in group) for group in self.experiments]  # repeats repeat the error of the model
        return min(sum(every), self.policy.max_effective_samples)

    @cached_property
    def gene_cost(self) -> float:
        """Evidence that a gene costs; of a few samples of a series less: half the logarithm of their number."""
        if self.kind != "series":
            return self.policy.gene_cost
        return float(min(0.5 * np.log(max(self.effective_samples, np.e)), self.policy.gene_cost))

    def deviance(self, coefficients: Float[Array, "*B D"]) -> Float[Array, "*B"]:
        """Return minus twice the log-likelihood [...] of residual ``coefficients`` [..., D].

        The residual consists of noise and an error of the model, to which the chi-squared beyond its expectation D is
        attributed. Only :attr:`effective_samples` values of that error are independent, and its size is unknown, so the
        likelihood depends on the logarithm of its mean square (as in Student's t).
        """
        whole = (self.whiten(coefficients) ** 2).sum(axis=-1)
        by_noise = np.minimum(whole, len(self.scale))
        beyond = self._chi_squared_excess(coefficients)
        return np.asarray(by_noise + self.effective_samples * np.log1p(beyond / self.effective_samples))

    def likelihood_weight(self, coefficients: Float[Array, " D"]) -> float:
        """Return the derivative of :meth:`deviance` with respect to chi-squared at ``coefficients`` [D], at most 1.

        A fit weights all squared residuals by it, as in iteratively reweighted least squares.
        """
        return float(1.0 / (1.0 + self._chi_squared_excess(coefficients) / self.effective_samples))

    @cached_property
    def max_likelihood_weight(self) -> float:
        """The :meth:`likelihood_weight` at a model error as large as the tolerance: no model is taken as more exact."""
        return float(1.0 / (1.0 + self.policy.tolerance**2 * len(self.scale) / self.effective_samples))

    def _chi_squared_excess(self, coefficients: Array) -> Array:
        return np.asarray(np.maximum((self.whiten(coefficients) ** 2).sum(axis=-1) - len(self.scale), 0.0))

    def excess(self, coefficients: Float[Array, " D"]) -> float:
        """Return the mean square of a residual with ``coefficients`` [D] minus that of the noise (m^2, N^2)."""
        return float(self.weight @ (coefficients**2 - self.variance))

    def excess_by_recording(self, coefficients: Float[Array, " D"]) -> Float[Array, " R"]:
        """Return the :meth:`excess` [R] of each of the R recordings (m^2 or N^2)."""
        every = self.weight * (coefficients**2 - self.variance)
        return np.array([every[part].sum() / self.recording_weights[r] for r, part in enumerate(self.recording_slices)])

    @cached_property
    def recording_weights(self) -> Float[Array, " R"]:
        """Fraction [R] of all used channels that belongs to each recording: its weight in the mean square."""
        used = np.array([int(fit.used.sum()) for fit in self.reduced], float)
        return np.asarray(used / used.sum())

    @cached_property
    def excess_standard_error(self) -> float:
        """Standard error of :meth:`excess` (m^2 or N^2) by noise alone.

        The noise of means and trends lies at lower frequencies than where noise is measured, between the harmonics, so
        its variance is known up to a factor only: half of it counts as error. The noise of different markers is
        independent. That of different harmonics is not, since beats differ in size or timing as a whole; so each
        marker, and a recording of forces as a whole, counts as one sample of its noise.
        The coefficients of a series have independent noise, whose variance is known up to a relative error.
        """
        every = self.weight * self.variance
        if self.kind == "series":
            known = max(one.relative_error for one in self.reduced if isinstance(one, SeriesFit))
            error = known if self.is_steady else MEASURED_ERROR
            return float(error * every.sum() + self.excess_standard_error_of_samples)
        independent = sum(
            1.0 if recording.kind == "forces" else fit.used.sum() / 3.0
            for recording, fit in zip(self.recordings, self.beat_fits, strict=True)
        )
        slow = np.concatenate([np.tile((v.order == 0) | v.trend, int(v.used.sum())) for v in self.beat_fits])
        return float(every[slow].sum() / 2.0 + np.sqrt(2.0 / independent) * every.sum())

    def excess_by_chance(self, coefficients: Float[Array, " D"]) -> float:
        """Return how much more (m^2) of a residual's :meth:`excess` ``rigid_errors`` explain than is expected of them.

        At least 0. Their mean square is a weighted sum of chi-squares, whose variance is twice the sum of squares of
        the quadratic form; chance is at most `Policy.refuting_excess` standard deviations.
        """
        if self.rigid_errors is None:
            return 0.0
        columns = self.whitened_slopes(self.rigid_errors)
        precision = columns.T @ columns + np.eye(columns.shape[1])
        amounts = np.linalg.solve(precision, columns.T @ self.whiten(coefficients))
        explained = self.weight @ (coefficients**2 - (coefficients - self.rigid_errors @ amounts) ** 2)
        form = self.rigid_errors.T @ (self.weight[:, None] * self.rigid_errors)
        most = self.policy.refuting_excess * np.sqrt(2.0 * np.sum(form**2))
        return float(np.clip(explained - np.trace(form), 0.0, most))

    @cached_property
    def excess_standard_error_of_samples(self) -> float:
        """Standard error of :meth:`excess` (m^2, N^2) by noise of known variance that is independent of each other."""
        return float(np.sqrt(2.0 * np.sum((self.weight * self.variance) ** 2)))

    def evaluate(
        self, problem: Problem, evaluator: Evaluator, values: Float[Array, "B F"]
    ) -> tuple[Float[Array, "B D"], tuple[str | None, ...], list[Array]]:
        """Simulate ``values`` [B, F] (B individuals, F free genes of ``problem``) and compare them with the recordings.

        Returns the coefficients [B, D] of the residuals, why each individual failed (None if it did not), and the
        residuals [B, T, C] of each recording, simulated minus recorded (m or N).
        """
        evaluation = evaluator.evaluate(problem, values, residuals=True)
        residuals = residuals_of(evaluation)
        return self.coefficients_of(residuals), evaluation.reasons, residuals
