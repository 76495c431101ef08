"""The power of changes from beat to beat, compared with that of the noise at the nearest spectral lines."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from wingfit.inference.noise.changes.slow_change import Change, independent_sources, rank
from wingfit.records.array_types import Array

RISE = 1.5  # largest ratio of the density of noise at a harmonic to that around it that counts as usual


@dataclass(frozen=True)
class ChangePowers:
    """Changes of D kinds (linear, curved) and noise near K harmonics, in C channels that have the same gaps.

    ``change`` [D, K, C]: sum of squares of the coefficients of the changes; ``near`` [K, L, C]: coefficients of noise
    at L nearby lines (:func:`envelopes`); ``alone``: the same without changes of higher degree; ``freedom`` [D + 1, K]:
    number of independent coefficients of the changes of each kind, and of the noise; ``level`` [C]: mean square of the
    samples without changes.
    """

    change: Array
    near: Array
    alone: Array
    freedom: Array
    level: Array

    @classmethod
    def of(
        cls, values: Array, steady: Array, changes: list[list[Array]], lines: list[Array], beyond: Array
    ) -> ChangePowers:
        """Project ``values`` [T, C], and ``steady`` [T, C] without changes, on bases [T, .] of each harmonic.

        ``beyond`` [T, .]: basis of changes that are neither looked for nor noise.
        """
        freedom = np.array([[rank(one) for one in row] for row in (*changes, lines)])
        change = np.array([[((one.T @ values) ** 2).sum(axis=0) for one in row] for row in changes])
        near = np.array([one.T @ steady for one in lines])
        noise = steady - beyond @ (beyond.T @ steady)
        alone = np.array([one.T @ noise for one in lines])
        return cls(change, near, alone, freedom, np.maximum((steady**2).mean(axis=0), 1e-300))

    def of_harmonics(self, which: list[int]) -> ChangePowers:
        """Return the powers of the harmonics at these places, of K."""
        alone, freedom = self.alone[which], self.freedom[:, which]
        return replace(self, change=self.change[:, which], near=self.near[which], alone=alone, freedom=freedom)


def compared(parts: list[ChangePowers], samples: int, freedom_of_sizes: tuple[float, float] | None = None) -> Change:
    """Compare the changes of all channels of the ``parts`` with their noise; ``samples``: number of values.

    Changes of the first kind alone are compared, and with those of each further kind; the least probable result counts.
    ``freedom_of_sizes``: degrees of freedom of the change and of the noise, if the noise is that beats scatter in size;
    None: noise that differs between harmonics and channels, as far as it does.
    """
    every = (
        (one.change, one.near, one.alone, np.repeat(one.freedom[..., None], len(one.level), axis=-1), one.level)
        for one in parts
    )
    change, near, alone, freedom, level = (np.concatenate(found, axis=-1) for found in zip(*every, strict=True))
    change, of_change = change.cumsum(axis=0), freedom[:-1].cumsum(axis=0)
    noise = (near**2).sum(axis=1) / freedom[-1]
    # Each channel is divided by its size, so that a loud one does not decide alone.
    around, lines = float((noise / level).mean()), freedom[-1].mean(axis=-1)
    # Size and start of a beat that scatter move all harmonics of all channels at once, so these are counted together.
    around_each = alone.reshape(len(alone), -1, 2, len(level)) / np.sqrt(level)
    by_line = around_each.transpose(1, 0, 2, 3).reshape(around_each.shape[1], -1)
    sources = independent_sources(by_line, lines.mean() / 2)
    found = []
    for power, count in zip(change, of_change, strict=True):
        ratio = float((power / count / level).mean() / max(around, 1e-300))
        degrees = freedom_of_sizes or (sources * count.mean() / 2, sources * lines.mean() / 2)
        chance = float(scipy.stats.f.sf(ratio / RISE, *degrees))
        found.append((len(change) * chance, -ratio))
    probability, ratio = min(found)
    beyond = float((change[-1] - of_change[-1] * noise).sum())
    return Change(-ratio, min(probability, 1.0), float(np.sqrt(max(beyond, 0.0) / samples)))


def envelopes(psi: Array, apparent: Array, k: float, distances: Array) -> Array:
    """Return the spectral lines at ``distances`` (in flap frequencies) on either side of harmonic ``k``, [T, .].

    As changes in time of its two phases: columns in pairs, one change times the cosine, and times the sine.
    """
    slow = waves(apparent, distances)[:, :, None]
    carrier = np.stack([np.cos(k * psi), np.sin(k * psi)], axis=1)[:, None, :]
    return np.asarray((slow * carrier).reshape(len(psi), -1))


def waves(apparent: Array, distances: Array) -> Array:
    """Cosines and sines [T, .] of the frequencies ``distances`` (in flap frequencies)."""
    angles = 2 * np.pi * apparent[:, None] * distances
    return np.hstack([np.cos(angles), np.sin(angles)])
