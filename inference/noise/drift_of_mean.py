"""A mean of the beat that changes slowly during a recording: found against noise that may be slow itself.

Noise rises towards frequency zero: 1/f noise, or a random walk, whose density grows with the inverse square of the
frequency. So the noise of a slow change of the mean is extrapolated from the lowest spectral lines by white noise plus
a random walk, the steepest noise that is usual. The two are fitted by Whittle's likelihood; of all mixtures that the
lines allow, the one with most noise in the change counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from wingfit.inference.noise.slow_change import Change, independent_sources, orthonormal
from wingfit.records.array_types import Array, Float

MEAN_LINES = 12  # spectral lines above zero from which the noise is extrapolated, up to half the flap frequency
CERTAIN_OF_MEAN = 1e-3  # probability of noise alone below which a change of the mean counts as found
ALLOWED = 1.0  # of minus the log-likelihood: mixtures of white noise and random walk that the lines allow
MIXTURES = np.concatenate([[0.0], np.logspace(-1.0, 4.0, 51)])  # random walk in line 1, over white noise
# Mean power of a random walk of power 1 / k^2 at line k: in the slow changes of degree 1 and 2, and in line 1 without
# changes of degree 1, or of both.
OF_SLOW = np.array([3.31, 0.79])
OF_FIRST_LINE = (0.62, 0.31)


@dataclass(frozen=True)
class MeanPowers:
    """Slow changes of the mean of D degrees, and noise at L lines above zero, in C channels that have the same gaps.

    ``slow`` [D, C]: squared coefficients of the changes; ``near`` [2 L, C]: coefficients of the noise, cosines first;
    ``level`` [C]: mean square of the samples without the changes.
    """

    slow: Float[Array, "D C"]
    near: Float[Array, "L2 C"]
    level: Float[Array, " C"]

    @classmethod
    def of(
        cls,
        values: Float[Array, "T C"],
        changes: list[Float[Array, "T 1"]],
        waves: Float[Array, "T L2"],
        periodic: Float[Array, "T P"],
    ) -> MeanPowers:
        """Project ``values`` [T, C] on slow ``changes`` of the mean and on the ``waves`` of L lines, cosines first.

        All are made orthogonal to the ``periodic`` basis [T, P], which is orthonormal.
        """
        every: list[Array] = []
        for one in changes:
            every.append(orthonormal(one, periodic, *every))
        slow = np.array([((one.T @ values) ** 2).sum(axis=0) for one in every])
        steady = values - sum(one @ (one.T @ values) for one in every)
        near = orthonormal(waves, periodic, *every).T @ steady
        return cls(slow, near, np.maximum((steady**2).mean(axis=0), 1e-300))


def mean_distances(beats: int) -> Float[Array, " L"]:
    """Distances [L] of the lines from zero, in flap frequencies, in a recording of whole ``beats``."""
    return np.arange(1, min(max(beats // 2, 1), MEAN_LINES) + 1) / beats


def change_of_mean(parts: list[MeanPowers], samples: int) -> Change:
    """Compare the slow changes of the mean in all channels of the ``parts`` with their noise.

    ``samples``: number of values. Linear changes alone are compared, and linear and curved ones together; the less
    probable result counts.
    """
    level = np.concatenate([one.level for one in parts])
    slow = np.concatenate([one.slow for one in parts], axis=1) / level
    near = np.concatenate([one.near for one in parts], axis=1) / np.sqrt(level)
    degrees, lines = len(slow), len(near) // 2
    power = (near[:lines] ** 2 + near[lines:] ** 2).mean(axis=1) / 2.0
    expected = _expected(power, degrees)
    sources = independent_sources(near[None], np.array([2.0 * lines]))
    found = []
    for count in range(1, degrees + 1):
        ratio = float(slow[:count].mean() / max(expected[:count].mean(), 1e-300))
        chance = float(stats.f.sf(ratio, sources * count, sources * 2 * lines))
        found.append((degrees * chance, -ratio))
    probability, ratio = min(found)
    beyond = float(((slow - expected[:, None]) * level).sum())
    return Change(-ratio, min(probability, 1.0), float(np.sqrt(max(beyond, 0.0) / samples)), CERTAIN_OF_MEAN)


def _expected(power: Array, degrees: int) -> Array:
    """Power [D] of noise in slow changes of each degree, the most that the ``power`` [L] of the lines allows."""
    lines = np.arange(1, len(power) + 1)
    walk = 1.0 / lines**2
    walk[0] = OF_FIRST_LINE[degrees - 1]
    shape = 1.0 + MIXTURES[:, None] * walk
    scale = np.maximum((power / shape).mean(axis=1), 1e-300)
    cost = np.log(shape).sum(axis=1) + len(lines) * np.log(scale)
    most = scale[:, None] * (1.0 + MIXTURES[:, None] * OF_SLOW[:degrees])
    return np.asarray(most[cost <= cost.min() + ALLOWED].max(axis=0))
