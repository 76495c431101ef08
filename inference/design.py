"""Optimal design: what recordings say about genes and about effects, before they are made.

All is linear algebra on Gram matrices. A recording is described by the changes Z [n, P] that P parameters make to its
simulated values, divided by the noise. :class:`Information` holds the products that its use needs: for least squares
that takes the noise as independent (its estimates scatter by the *sandwich*, White 1982), and for the likelihood with
the true noise. Recordings add up. D-optimal recordings maximise the determinant of the information about the genes
(Wald 1943), found by greedy addition and exchange (Fedorov 1972). T-optimal ones maximise the squared distance between
two hypotheses after the genes of the second are fitted (Atkinson and Fedorov 1975).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float, Index, Int

UNKNOWN = 1e6  # standard deviation of an offset without a prior, relative to the noise
ROUNDS = 20  # of exchanges; each improves the score
LEAST_GAIN = 1e-9  # of the score: exchanges that gain less are not made
RIDGE = 1e-9  # of the largest curvature: changes that others explain exactly


@dataclass(frozen=True)
class Information:
    """What recordings say about P parameters; sums of recordings are sums of matrices.

    Attributes:
        assumed: Z^T W Z [P, P], the information if the noise were independent, of the covariance W^-1.
        scores: Z^T W N W Z [P, P], the covariance of the scores Z^T W v under the true noise v of covariance N.
        true: Z^T N^-1 Z [P, P], the information of the likelihood with the true noise.
        fixed: [P, P] covariance of the scores by disturbances that are constant in a recording, such as a wrong zero:
            they do not average out with more samples.
    """

    assumed: Float[Array, "P P"]
    scores: Float[Array, "P P"]
    true: Float[Array, "P P"]
    fixed: Float[Array, "P P"]

    @classmethod
    def none(cls, size: int) -> Information:
        """Return no information about ``size`` parameters."""
        zero = np.zeros((size, size))
        return cls(zero, zero, zero, zero)

    @classmethod
    def of(
        cls,
        changes: Float[Array, "n P"],
        variance: Float[Array, " n"],
        shared: Float[Array, "n K"] | None = None,
        shift: tuple[Float[Array, " n"], Float[Array, " n"]] | None = None,
        weight: Float[Array, " n"] | None = None,
        constant: Float[Array, "n L"] | None = None,
        times: float = 1.0,
    ) -> Information:
        """Return the information of ``changes`` [n, P] with noise of covariance diag(variance) + shared shared^T.

        ``shared`` [n, K]: changes by one standard deviation of each of K random disturbances. ``shift`` = (u, w): the
        recording is aligned by an offset that is estimated from it, so that noise v enters as v + u (w . v).
        ``weight`` [n] of the squares in a least-squares fit; None: 1. ``constant`` [n, L]: changes by L disturbances
        that do not average out. The recording has ``times`` as many samples as the changes.
        """
        none = np.zeros((len(variance), 0))
        common, steady = none if shared is None else shared, none if constant is None else constant
        weighted = changes if weight is None else changes * weight[:, None]
        spread = weighted
        if shift is not None:
            along, offset = shift
            spread = weighted + np.outer(offset, along @ weighted)
        scores = spread.T @ (spread * variance[:, None])
        across = spread.T @ common
        white = changes / variance[:, None]
        true = changes.T @ white
        moved = none if shift is None else shift[0][:, None] * UNKNOWN
        lost = np.hstack([common, steady * np.sqrt(times), moved])
        if lost.shape[1]:
            light = lost.T @ white
            own = np.eye(lost.shape[1]) + lost.T @ (lost / variance[:, None])
            true = true - light.T @ np.linalg.solve(own, light)
        always = spread.T @ steady
        return cls(changes.T @ weighted, scores + across @ across.T, true, always @ always.T).times(times)

    def __add__(self, other: Information) -> Information:
        """Return the information of both sets of recordings."""
        return Information(
            self.assumed + other.assumed,
            self.scores + other.scores,
            self.true + other.true,
            self.fixed + other.fixed,
        )

    def times(self, factor: float) -> Information:
        """Return the information of recordings with ``factor`` times as many samples.

        ``true`` is then that of the same weight of constant disturbances.
        """
        return Information(factor * self.assumed, factor * self.scores, factor * self.true, factor**2 * self.fixed)

    def about(self, columns: Int[Index, " Q"]) -> Information:
        """Return the information about the parameters ``columns`` [Q] alone, the others being known."""
        part = np.ix_(columns, columns)
        return Information(self.assumed[part], self.scores[part], self.true[part], self.fixed[part])

    def covariance(self, prior: Float[Array, " P"]) -> Float[Array, "P P"]:
        """Return the covariance [P, P] of least-squares estimates; ``prior`` [P]: information of a normal prior."""
        bread = np.linalg.inv(self.assumed + np.diag(prior))
        return np.asarray(bread @ (self.scores + self.fixed + np.diag(prior)) @ bread)


def after_fit(true: Float[Array, "P P"], genes: Int[Index, " F"], prior: Float[Array, " F"]) -> Float[Array, "P P"]:
    """Return the information [P, P] about all parameters after the parameters ``genes`` [F] are fitted.

    ``prior`` [F]: information of their normal prior. Rows and columns of the genes become zero.
    """
    own = true[np.ix_(genes, genes)] + np.diag(prior)
    across = true[genes]
    rest = true - across.T @ np.linalg.solve(own, across)
    rest[genes], rest[:, genes] = 0.0, 0.0
    return np.asarray(0.5 * (rest + rest.T))


def squared_distance(rest: Float[Array, "P P"], one: int, rival: Int[Index, " Q"]) -> float:
    """Return the squared distance of the change ``one`` from all combinations of the changes ``rival`` [Q].

    ``rest`` [P, P]: :func:`after_fit`. The changes are in standard deviations of the noise. An empty ``rival`` gives
    the squared length of the change.
    """
    whole = float(rest[one, one])
    if not len(rival) or whole <= 0.0:
        return max(whole, 0.0)
    gram, across = rest[np.ix_(rival, rival)], rest[rival, one]
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    unit = gram / scale / scale[:, None] + RIDGE * np.eye(len(rival))
    across = across / scale
    return float(np.clip(whole - across @ np.linalg.solve(unit, across), 0.0, whole))


def cosine(rest: Float[Array, "P P"], one: int, rival: Int[Index, " Q"]) -> float:
    """Return the cosine (0 to 1) between the change ``one`` and the nearest combination of the changes ``rival``."""
    whole = float(rest[one, one])
    return 0.0 if whole <= 0.0 else float(np.sqrt(1.0 - squared_distance(rest, one, rival) / whole))


def detection_probability(distance: float, freedom: int, false_alarm: float) -> float:
    """Return the power of the likelihood-ratio test (Wilks 1938) of ``freedom`` parameters at a squared ``distance``.

    ``false_alarm``: probability that the test rejects the nominal model although it is right.
    """
    return float(scipy.stats.ncx2.sf(scipy.stats.chi2.isf(false_alarm, freedom), freedom, max(distance, 1e-12)))


def detectable_distance(freedom: int, false_alarm: float, power: float) -> float:
    """Return the squared distance at which :func:`detection_probability` is ``power``."""
    return float(scipy.optimize.brentq(lambda d: detection_probability(d, freedom, false_alarm) - power, 1e-9, 1e4))


def odds_probability(distance: float, odds: float) -> float:
    """Return the probability that two hypotheses at a squared ``distance`` get likelihood ``odds`` for the right one.

    The logarithm of the ratio of two normal likelihoods is normal, with mean distance / 2 and variance distance.
    """
    if distance <= 0.0:
        return 0.0
    return float(scipy.stats.norm.sf((np.log(odds) - 0.5 * distance) / np.sqrt(distance)))


def separable_distance(odds: float, power: float) -> float:
    """Return the squared distance at which :func:`odds_probability` is ``power``."""
    quantile = scipy.stats.norm.isf(1.0 - power)
    return float((quantile + np.sqrt(quantile**2 + 2.0 * np.log(odds))) ** 2)


def log_determinant(information: Float[Array, "F F"]) -> float:
    """Return the logarithm of the determinant of ``information`` [F, F]; minus infinity if it is singular."""
    sign, value = np.linalg.slogdet(information)
    return float(value) if sign > 0 else -np.inf


def greedy_exchange(score: Callable[[Sequence[int]], float], candidates: int, count: int) -> list[int]:
    """Choose ``count`` of ``candidates``, repetitions allowed, with a large ``score``, best additions first.

    One is added at a time, always the one with the largest score; then single ones are exchanged for others as long as
    the score increases (Fedorov 1972). The order is that in which a greedy search would add the chosen ones.
    """
    chosen = list[int]()
    for _ in range(count if candidates else 0):
        chosen.append(max(range(candidates), key=lambda k: score([*chosen, k])))
    best = score(chosen) if chosen else 0.0
    for _ in range(ROUNDS if count > 1 else 0):
        improved = False
        for place in range(len(chosen)):
            others = chosen[:place] + chosen[place + 1 :]
            k = max(range(candidates), key=lambda k: score([*others, k]))
            found = score([*others, k])
            if found > best + LEAST_GAIN * max(abs(best), 1.0):
                chosen, best, improved = [*others, k], found, True
        if not improved:
            break
    left, ordered = list(chosen), list[int]()
    while left:
        nearest = max(left, key=lambda k: score([*ordered, k]))
        left.remove(nearest)
        ordered.append(nearest)
    return ordered
