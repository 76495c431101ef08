"""The hypotheses that a next recording should distinguish, and by how much their predictions differ.

A difference that the genes of a hypothesis can compensate distinguishes nothing. How far they can adapt follows from
what the recordings so far and the new one say about them together (T-optimality: Atkinson and Fedorov 1975, with the
posterior of the genes). The remaining misfit of a hypothesis counts as noise of its genes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wingfit.diagnosis.evidence.fit import PRIOR_SD
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights
from wingfit.inference.design import after_fit, squared_distance
from wingfit.records.array_types import Array, Bool, Float, Mask

MIN_PROBABILITY = 0.02  # of a hypothesis that is compared
MAX_RIVALS = 3  # hypotheses that are compared


def rivals_of(weights: HypothesisWeights) -> tuple[int, ...]:
    """Return the numbers of the probable hypotheses, most probable first; if it is a single one, also the next.

    Empty if none is probable.
    """
    order = np.argsort(-weights.probabilities, kind="stable")
    likely = [int(k) for k in order if weights.probabilities[k] >= MIN_PROBABILITY]
    return tuple([int(k) for k in order[:2]] if len(likely) == 1 else likely[:MAX_RIVALS])


@dataclass(frozen=True, eq=False)
class Prediction:
    """What the K rivals predict of a new recording, as products of changes of its values.

    The P changes are those by the genes of each rival (0 to 1), rival by rival, and then the differences of the
    predictions of all from that of the first.

    Attributes:
        mean: [P, P] mean products over the samples and channels, in variances of the noise.
        true: [P, P] products relative to the noise, summed (:class:`wingfit.inference.design.Information`).
    """

    mean: Float[Array, "P P"]
    true: Float[Array, "P P"]

    @classmethod
    def of(cls, changes: Float[Array, "n P"], weight: float, white: Float[Array, "n P"]) -> Prediction:
        """Return the prediction from ``changes``, the squares of which have ``weight``, and ``white`` ones."""
        return cls(weight * changes.T @ changes, white.T @ white)

    def longer(self, times: float) -> Prediction:
        """Return the prediction of a recording with ``times`` as many samples."""
        return Prediction(self.mean, times * self.true)


@dataclass(frozen=True, eq=False)
class Rivals:
    """The rivals among the hypotheses of ``weights``, and what the recordings in ``data`` say about their genes."""

    data: WhitenedData
    weights: HypothesisWeights
    numbers: tuple[int, ...]

    @classmethod
    def among(cls, data: WhitenedData, weights: HypothesisWeights) -> Rivals:
        """Return the probable hypotheses of ``weights``."""
        return cls(data, weights, rivals_of(weights))

    @cached_property
    def refits(self) -> tuple[Refit, ...]:
        """The rivals, most probable first."""
        return tuple(self.weights.refits[k] for k in self.numbers)

    @property
    def names(self) -> tuple[str, ...]:
        """What each assumes to be missing."""
        return tuple(" and ".join(one.names) or "no missing physics" for one in self.refits)

    @property
    def words(self) -> str:
        """The titles of the rivals as text."""
        titles = [[trial.suspect.title.lower() for trial in one.trials] for one in self.refits]
        return " and ".join(" with ".join(names) or "no missing physics" for names in titles)

    @cached_property
    def _weights(self) -> list[float]:
        return [self.data.likelihood_weight(one.fit.coefficients) for one in self.refits]

    @cached_property
    def _known(self) -> list[Array]:
        """What the recordings say about the genes of each rival, with their prior."""
        found = list[Array]()
        for one, weight in zip(self.refits, self._weights, strict=True):
            slopes = self.data.whitened_slopes(one.fit.jacobian)
            found.append(weight * slopes.T @ slopes + np.eye(slopes.shape[1]) / PRIOR_SD**2)
        return found

    @cached_property
    def _elsewhere(self) -> list[Array]:
        """Mean square change [F, F] of all recordings so far by the genes of each rival, in variances of the noise."""
        jacobians = [one.fit.jacobian for one in self.refits]
        return [(one * self.data.weight[:, None]).T @ one / self.data.noise**2 for one in jacobians]

    def stacked(self, slopes: Sequence[Float[Array, "n _"]], values: Sequence[Float[Array, " n"]]) -> Array:
        """Return the changes [n, P] of a :class:`Prediction`; ``slopes`` [n, F] and ``values`` [n]: of each rival."""
        differences = [one - values[0] for one in values]
        return np.hstack([*slopes, np.stack(differences, axis=1)])

    def apart(
        self, seen: Prediction, share: float, new: Callable[[int], Bool[Mask, " F"]] | None = None
    ) -> tuple[Float[Array, "K K"], Float[Array, "K K"]]:
        """Return by how much the prediction of each rival (column) differs from that of the right one (row).

        The first matrix is the mean square in variances of the noise, the second the squared distance of all samples in
        those of their noise. Genes that adapt to the new recording fit the others worse: that counts as a difference
        too, as if it were in the new one, which has the ``share`` of all channels. ``new``: of the genes of rival k,
        those [F] that are unknown in the recording, such as its start; None: all recordings have the same.
        """
        count, ends = len(self.numbers), np.cumsum([0, *(len(one.fit.unit) for one in self.refits)])
        mean, distance = np.zeros((count, count)), np.zeros((count, count))
        for j, (weight, whole) in enumerate(zip(self._weights, self._known, strict=True)):
            genes = np.arange(ends[j], ends[j + 1])
            own = np.zeros(len(genes), bool) if new is None else new(j)
            known = whole if new is None else forgotten(whole, own)
            worse = self._elsewhere[j] * (1.0 - share) / share * ~own * ~own[:, None]
            for k in range(count):
                if k != j:
                    select = np.zeros((len(seen.mean), len(genes) + 1))
                    select[genes, np.arange(len(genes))] = 1.0
                    select[ends[-1] + j, -1] += 1.0
                    select[ends[-1] + k, -1] -= 1.0
                    mean[k, j], distance[k, j] = _adapted(seen, select, known, worse, weight)
        return mean, distance


def _adapted(
    seen: Prediction,
    select: Float[Array, "P Q"],
    known: Float[Array, "F F"],
    worse: Float[Array, "F F"],
    weight: float,
) -> tuple[float, float]:
    """Return mean square and squared distance of the last of the changes ``select`` after the first F adapt.

    ``known`` [F, F]: information about these; ``worse`` [F, F]: mean square change of other recordings by them.
    """
    genes = np.arange(select.shape[1] - 1)
    both = weight * select.T @ seen.true @ select
    both[np.ix_(genes, genes)] += known
    distance = squared_distance(after_fit(both, genes, np.zeros(len(genes))), len(genes), np.empty(0, int)) / weight
    move = -np.linalg.solve(both[np.ix_(genes, genes)], both[genes, -1])
    change = np.append(move, 1.0)
    mean = float(change @ (select.T @ seen.mean @ select) @ change + move @ worse @ move)
    return max(mean, 0.0), distance


def forgotten(information: Float[Array, "F F"], unknown: Bool[Mask, " F"]) -> Float[Array, "F F"]:
    """Return ``information`` about the other genes whatever the ``unknown`` ones were, and the prior of these."""
    others = ~unknown
    found = np.diag(np.where(unknown, PRIOR_SD**-2, 0.0))
    across = information[np.ix_(others, unknown)]
    lost = across @ np.linalg.solve(information[np.ix_(unknown, unknown)], across.T) if unknown.any() else 0.0
    found[np.ix_(others, others)] = information[np.ix_(others, others)] - lost
    return np.asarray(found)
