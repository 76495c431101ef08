"""How probably a further recording settles which hypothesis is right, by the rules that decide a verdict.

Let the hypothesis k be right. In a new recording each rival j then has the excess of k and the mean square s^2 by which
its prediction differs from that of k after its genes have adapted. What k itself leaves is not noise of many samples,
but an error of the model that has few independent ones. So the excess of j scatters by 2 s sqrt(V / n), V the mean
square that a right model may leave beside what k does leave, n the effective samples of a recording
(:class:`wingfit.diagnosis.policy.Policy`); and by 2 s^2 / sqrt(D) by noise, D the squared distance of the predictions
(:mod:`wingfit.inference.design`). A repetition has the errors of the model that it repeats, so that only noise is new.
The evidence of every hypothesis follows, and :func:`wingfit.diagnosis.verdict.verdict.decide` gives the verdict. The
probability is the mean over draws of these errors, and over the hypotheses by their present probabilities. A law
outside the library predicts nothing: if that is right, nothing counts as settled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.verdict import decide
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, noise_error, tolerated_excess
from wingfit.records.array_types import Array, Float

DRAWS = 64
LEAST_DISTANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Expected:
    """The excess of H hypotheses in a new recording, in variances of the noise, if each of K rivals is right.

    Attributes:
        excess: [K, H] mean.
        by_noise: [K, H] standard deviation by noise.
        by_model: [K, H] standard deviation by the error of the model.
    """

    excess: Float[Array, "K H"]
    by_noise: Float[Array, "K H"]
    by_model: Float[Array, "K H"]

    def with_part(self, other: Expected, part: float) -> Expected:
        """Return what a recording shows of which the ``part`` (0 to 1) of the channels is that of ``other``."""
        pairs = zip(
            (self.excess, self.by_noise, self.by_model), (other.excess, other.by_noise, other.by_model), strict=True
        )
        return Expected(*((1.0 - part) * one + part * two for one, two in pairs))


@dataclass(frozen=True, eq=False)
class Settling:
    """Predicts verdicts with one more recording.

    Attributes:
        data: the recordings so far.
        weights: of the H hypotheses.
        rivals: [K] numbers of those of which one may be right.
        floor: error of the discretisation, m or N.
    """

    data: WhitenedData
    weights: HypothesisWeights
    rivals: tuple[int, ...]
    floor: float

    @cached_property
    def _error(self) -> float:
        """Standard error of an excess by noise, in variances of the noise."""
        return noise_error(self.data, self.weights.refits) / self.data.noise**2

    @cached_property
    def _tolerated(self) -> float:
        """Excess that a right hypothesis may have, in variances of the noise."""
        data = self.data
        nominal = self.weights.refits[0].excess
        return tolerated_excess(data, nominal, self.floor, self._error * data.noise**2) / data.noise**2

    def elsewhere(self, apart: Float[Array, "K K"], distance: Float[Array, "K K"]) -> Expected:
        """Return what a recording under another condition, or of other channels, shows.

        ``apart``: mean square by which the prediction of each rival (column) differs from that of the right one (row),
        in variances of the noise; ``distance``: squared distance, of all samples.
        """
        rivals, own = list(self.rivals), self.weights.excess
        excess = np.tile(own, (len(rivals), 1))
        by_noise, by_model = np.zeros_like(excess), np.zeros_like(excess)
        excess[:, rivals] = own[rivals][:, None] + apart
        by_noise[:, rivals] = _scatter(apart, distance)
        error = (self._tolerated + own[rivals]) / self.data.policy.effective_samples
        by_model[:, rivals] = 2.0 * np.sqrt(apart * error[:, None])
        return Expected(excess, by_noise, by_model)

    def again(self, recording: int, apart: Float[Array, "K K"], distance: Float[Array, "K K"]) -> Expected:
        """Return what a repetition of the fitted ``recording`` shows: the excess that it had, and new noise."""
        found = [self.data.excess_by_recording(one.fit.coefficients)[recording] for one in self.weights.refits]
        excess = np.tile(np.maximum(found, 0.0) / self.data.noise**2, (len(self.rivals), 1))
        by_noise = np.zeros_like(excess)
        by_noise[:, list(self.rivals)] = _scatter(apart, distance)
        return Expected(excess, by_noise, np.zeros_like(excess))

    def probability(self, expected: Expected, share: float, samples: float, longer: float = 1.0) -> float:
        """Return the probability that a diagnosis with one more recording names the right hypothesis alone.

        ``share``: part of all channels that the recording has then; ``samples``: effective ones that it adds;
        ``longer``: times as many beats as a recording had so far, so that its noise averages out.
        """
        data, weights, policy = self.data, self.weights, self.data.policy
        before = data.effective_samples
        after = max(min(before + samples, policy.max_effective_samples), before)
        tolerated = self._tolerated - policy.allowance * self._error * share * (1.0 - 1.0 / longer)
        known = np.log(np.maximum(weights.probabilities, 1e-300)) + 0.5 * before * np.log(
            self._tolerated + weights.excess
        )
        outside = policy.unknown_residual**2 * weights.excess[0]
        unknown = np.log(max(weights.unknown, 1e-300)) + 0.5 * before * np.log(self._tolerated + outside)
        unknown -= 0.5 * after * np.log(tolerated + outside)
        total = 0.0
        for row, right in enumerate(self.rivals):
            new = (
                expected.excess[row]
                + expected.by_noise[row] * self._draws[0][:, None]
                + expected.by_model[row] * self._draws[1]
            )
            excess = (1.0 - share) * weights.excess + share * np.maximum(new, 0.0)
            evidence = known - 0.5 * after * np.log(tolerated + excess)
            settled = [self._settled(one, unknown, right) for one in evidence]
            total += float(weights.probabilities[right]) * float(np.mean(settled))
        return min(total, 1.0)

    @cached_property
    def _draws(self) -> tuple[Float[Array, " N"], Float[Array, "N H"]]:
        """Standard normal numbers, always the same: of noise, and of the error of the model."""
        rng = np.random.default_rng(0)
        return rng.standard_normal(DRAWS), rng.standard_normal((DRAWS, len(self.weights.refits)))

    def _settled(self, evidence: Float[Array, " H"], unknown: float, right: int) -> bool:
        """Return whether the verdict from ``evidence``, logarithms of probabilities, is that ``right`` is right."""
        weights = self.weights
        top = max(float(evidence.max()), unknown)
        parts, other = np.exp(evidence - top), float(np.exp(unknown - top))
        total = float(parts.sum()) + other
        found = decide(replace(weights, probabilities=parts / total, unknown=other / total))
        if found.verdict == "adequate":
            return right == 0
        return found.verdict not in ("ambiguous", "unnamed") and set(found.named) == set(weights.refits[right].names)


def share_of(channels: Sequence[float] | Float[Array, " R"], new: float) -> float:
    """Return the part that ``new`` channels have of all, beside the ``channels`` of the recordings so far."""
    return float(new / (np.sum(channels) + new))


def _scatter(apart: Array, distance: Array) -> Array:
    return np.asarray(2.0 * apart / np.sqrt(np.maximum(distance, LEAST_DISTANCE)) * (apart > 0.0))
