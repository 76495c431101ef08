"""A mean of the beat that changes slowly during a recording: found against noise that may be slow itself.

Noise rises towards frequency zero: 1/f noise, or a random walk, whose density grows with the inverse square of the
frequency. So the noise of a slow change of the mean is extrapolated from the lowest spectral lines by white noise plus
a random walk, the steepest noise that is usual. The two are fitted by Whittle's likelihood; of all mixtures that the
lines allow, the one with most noise in the change counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.inference.noise.changes.slow_change import Change, independent_sources
from wingfit.records.array_types import Array, Float

MEAN_LINES = 12  # spectral lines above zero from which the noise is extrapolated, up to half the flap frequency
CERTAIN_OF_MEAN = 1e-3  # probability of noise alone below which a change of the mean counts as found
ALLOWED = 0.5  # of minus the log-likelihood: mixtures of white noise and random walk that the lines allow
MIXTURES = np.concatenate([[0.0], np.logspace(-1.0, 4.0, 51)])  # random walk over white noise, where it is largest


@dataclass(frozen=True)
class MeanPowers:
    """Slow changes of the mean of D degrees, and noise at L lines above zero, in C channels that have the same gaps.

    ``slow`` [D, C]: squared coefficients of the changes; ``near`` [2 L, C]: coefficients of the noise, cosines first;
    ``level`` [C]: mean square of the samples without the changes; ``walk`` [D + L]: mean square that a random walk has
    in each change and in each line.
    """

    slow: Float[Array, "D C"]
    near: Float[Array, "L2 C"]
    level: Float[Array, " C"]
    walk: Float[Array, " DL"]

    @classmethod
    def of(
        cls,
        values: Float[Array, "T C"],
        steady: Float[Array, "T C"],
        changes: list[Float[Array, "T 1"]],
        lines: Float[Array, "T L2"],
    ) -> MeanPowers:
        """Project ``values`` [T, C] on slow ``changes`` of the mean, and ``steady`` [T, C] on spectral ``lines``.

        ``steady``: the values without slow changes of mean and harmonics; ``lines``: orthonormal cosines and sines of L
        lines above zero, cosines first, orthogonal to slow changes and mean beat. The changes are orthonormal, too.
        """
        slow = np.array([((one.T @ values) ** 2).sum(axis=0) for one in changes])
        # A random walk is a sum of independent steps; each step shifts all samples that follow it.
        walk = [(np.cumsum(one, axis=0) ** 2).sum(axis=0) for one in (*changes, lines)]
        of_lines = walk.pop().reshape(2, -1).mean(axis=0)
        level = np.maximum((steady**2).mean(axis=0), 1e-300)
        return cls(slow, lines.T @ steady, level, np.concatenate([*walk, of_lines]))


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
    walk = np.average([one.walk for one in parts], axis=0, weights=[len(one.level) for one in parts])
    expected = _expected(power, walk[degrees:], walk[:degrees])
    sources = independent_sources(near, 2.0 * lines)
    found = []
    for count in range(1, degrees + 1):
        ratio = float(slow[:count].mean() / max(expected[:count].mean(), 1e-300))
        chance = float(scipy.stats.f.sf(ratio, sources * count, sources * 2 * lines))
        found.append((degrees * chance, -ratio))
    probability, ratio = min(found)
    beyond = float(((slow - expected[:, None]) * level).sum())
    return Change(-ratio, min(probability, 1.0), float(np.sqrt(max(beyond, 0.0) / samples)), CERTAIN_OF_MEAN)


def _expected(power: Array, walk: Array, of_slow: Array) -> Array:
    """Power [D] of noise in slow changes of each degree, the most that the ``power`` [L] of the lines allows.

    ``walk`` [L] and ``of_slow`` [D]: power of a random walk in the lines and in the slow changes.
    """
    mixtures = MIXTURES[:, None] / walk.max()
    shape = 1.0 + mixtures * walk
    scale = np.maximum((power / shape).mean(axis=1), 1e-300)
    cost = np.log(shape).sum(axis=1) + len(power) * np.log(scale)
    most = scale[:, None] * (1.0 + mixtures * of_slow)
    return np.asarray(most[cost <= cost.min() + ALLOWED].max(axis=0))
