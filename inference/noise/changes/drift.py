"""A beat that changes slowly during a recording: found against the noise, and kept apart from it.

Stiffness, damping or a motor that drift change size and phase of the harmonics slowly. The power of such a change lies
next to the harmonics, so close that it looks like noise of long memory. But noise, whatever its colour, has about the
same density at all frequencies near a harmonic, unless a resonance is narrower than the distance of a few spectral
lines. So the power of the slow change of a harmonic is compared with the power of the nearest spectral lines: their
ratio, pooled over harmonics and channels, follows an F distribution for noise alone. Its degrees of freedom count
harmonics, their two phases, and channels only as far as their noise near the harmonics is independent and of similar
size: beats that scatter in size change all of them alike.

The mean of the beat is compared apart from the harmonics, because slow noise rises towards it
(:mod:`wingfit.inference.noise.changes.drift_of_mean`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre

from wingfit.inference.noise.changes.change_powers import ChangePowers, compared, envelopes, waves
from wingfit.inference.noise.changes.drift_of_mean import MeanPowers, change_of_mean, mean_distances
from wingfit.inference.noise.changes.slow_change import Change, orthonormal
from wingfit.inference.noise.mean_beat import fourier_basis, masks_of
from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

HARMONICS = 3  # compared: those in which a wing moves most
FEWEST_BEATS = 3  # with which lines remain that the change does not use up
FEWEST_OF_MEAN = 4  # with which two lines above zero show how noise rises towards it
CURVED = 4  # beats from which a curved change is found and removed, too
WINDING = 12  # beats from which changes of higher degree are kept out of the noise
NEAREST = 3  # spectral lines on either side of a harmonic: farther ones say less about the noise at the harmonic


@dataclass(frozen=True)
class Drift:
    """A slow change during a recording: of the first harmonics (``beat``), and of the ``mean`` of the beat."""

    beat: Change
    mean: Change

    @property
    def found(self) -> bool:
        """Whether noise alone does not explain one of the changes."""
        return self.beat.found or self.mean.found

    @property
    def size(self) -> float:
        """Root mean square of the changes that were found, beyond the noise, over all samples and channels, m or N."""
        return float(np.sqrt(sum(one.size**2 for one in (self.beat, self.mean) if one.found)))

    @property
    def ratio(self) -> float:
        """Power of the larger of the changes that were found to that of the noise near it; 0 if there is none."""
        return max((one.ratio for one in (self.beat, self.mean) if one.found), default=0.0)

    def words(self, size: str) -> str:
        """Describe the changes that were found, with their ``size`` as text with its unit."""
        what = f"by {size}" if self.beat.found else f"its mean by {size}"
        return f"{what}, {self.ratio:.2g} times the power of noise"


def drift_of(
    scatter: Float[Array, "T C"],
    valid: Bool[Mask, "T C"],
    psi: Float[Array, " T"],
    apparent: Float[Array, " T"],
    harmonics: int,
    beats: int,
    least: float = 0.0,
) -> Drift | None:
    """Compare the slow changes of the first harmonics, and of the mean, with the noise near them.

    ``scatter`` [T, C]: recorded values minus mean beat, zero where not ``valid``; ``psi`` [T]: phase (rad) of the beat,
    ``apparent`` [T]: time in apparent beats; ``harmonics``: of the mean beat; ``beats``: whole apparent beats. The
    change is linear or, from CURVED beats on, curved. ``least`` (m or N): changes of smaller root mean square count as
    none. None with too few beats, or too few samples between gaps.
    """
    if beats < FEWEST_BEATS:
        return None
    orders, time = range(1, min(HARMONICS, harmonics) + 1), _time(apparent)
    distances = np.arange(1, min(beats // 2, NEAREST) + 1) / beats
    parts, of_mean = [], []
    for mask, channels in masks_of(valid):
        if not mask.any():
            continue
        periodic = orthonormal(fourier_basis(psi[mask], harmonics))
        # The changes of the mean and of the harmonics are not orthogonal, and a large one must not appear in another.
        of_zero = [_slow(psi[mask], time[mask], 0, degree) for degree in _degrees(beats)]
        mean = orthonormal(np.hstack(of_zero), periodic)
        changes: list[list[Array]] = []
        for degree in _degrees(beats):
            lower = zip(*changes, strict=True) if changes else [()] * len(orders)
            new = [_slow(psi[mask], time[mask], k, degree) for k in orders]
            changes.append([orthonormal(one, periodic, mean, *less) for one, less in zip(new, lower, strict=True)])
        beat = orthonormal(np.hstack([one for row in changes for one in row]))
        every = np.hstack([mean, beat])
        lines = [orthonormal(envelopes(psi[mask], apparent[mask], k, distances), periodic, every) for k in orders]
        higher = [_slow(psi[mask], time[mask], k, degree) for k in orders for degree in _higher(beats)]
        beyond = orthonormal(np.hstack(higher), periodic, every) if higher else every[:, :0]
        values = scatter[np.ix_(mask, channels)]
        steady = values - every @ (every.T @ values)
        parts.append(ChangePowers.of(values, steady, changes, lines, beyond))
        if beats < FEWEST_OF_MEAN:
            continue
        raw = [_slow(psi[mask], time[mask], k, degree) for k in orders for degree in _degrees(beats)]
        own = orthonormal(np.hstack(raw), periodic)
        slow: list[Array] = []
        for one in of_zero:
            slow.append(orthonormal(one, periodic, own, *slow))
        low = orthonormal(waves(apparent[mask], mean_distances(beats)), periodic, every)
        of_mean.append(MeanPowers.of(values, steady, slow, low))
    if not parts or min(float(one.freedom.min()) for one in parts) < 1.0:
        return None
    samples = int(valid.sum())
    changes_found = (compared(parts, samples), change_of_mean(of_mean, samples) if of_mean else Change(0.0, 1.0, 0.0))
    return Drift(*(one if one.size >= least else replace(one, probability=1.0) for one in changes_found))


def slow_basis(
    psi: Float[Array, " T"], apparent: Float[Array, " T"], beats: int, harmonics: int
) -> tuple[Float[Array, "T P"], Int[Index, " P"]]:
    """Slow changes of mean and first harmonics, as columns [T, P], and the harmonic [P] of each.

    Linear changes and, from CURVED beats on, curved ones. ``psi`` [T]: phase (rad) of the beat; ``apparent`` [T]: time
    in apparent beats; ``beats``: whole ones; ``harmonics``: of the mean beat.
    """
    orders, time = range(min(HARMONICS, harmonics) + 1), _time(apparent)
    columns = [np.hstack([_slow(psi, time, k, degree) for degree in _degrees(beats)]) for k in orders]
    return np.hstack(columns), np.repeat(orders, [part.shape[1] for part in columns])


def _degrees(beats: int) -> tuple[int, ...]:
    """Degrees of the slow changes that are seen in so many ``beats``: 1 linear, 2 curved."""
    return (1, 2) if beats >= CURVED else (1,)


def _higher(beats: int) -> tuple[int, ...]:
    """Degrees of slow changes that are not looked for, but are no noise either: a change need not be a parabola."""
    return (3, 4) if beats >= WINDING else ()


def _time(apparent: Array) -> Array:
    """Time [T] from -1 at the first sample to 1 at the last."""
    return np.asarray(2.0 * (apparent - apparent[0]) / (apparent[-1] - apparent[0]) - 1.0)


def _slow(psi: Array, time: Array, k: int, degree: int) -> Array:
    """Slow change [T, .] of harmonic ``k`` (0: of the mean): a Legendre polynomial of the ``time`` [T], -1 to 1."""
    slow = legendre.legval(time, np.eye(degree + 1)[degree])[:, None]
    return np.hstack([slow * np.cos(k * psi)[:, None], slow * np.sin(k * psi)[:, None]]) if k else slow
