"""A beat that changes slowly during a recording: found against the noise, and kept apart from it.

Stiffness, damping or a motor that drift change size and phase of the harmonics slowly. The power of such a change lies
next to the harmonics, so close that it looks like noise of long memory. But noise, whatever its colour, has about the
same density at all frequencies near a harmonic. So the power of the linear change of a harmonic is compared with the
power of the spectral lines around it: their ratio, pooled over harmonics and channels, follows an F distribution for
noise alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from wingfit.inference.noise.mean_beat import fourier_basis
from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

HARMONICS = 3  # compared: those in which a wing moves most
FEWEST_BEATS = 3  # with which lines remain that the change does not use up
LONG = 6  # beats from which a curved change is removed, too
CERTAIN = 1e-5  # probability of noise alone below which a change counts as found
LEAST_RATIO = 1.5  # of its power to that of noise: less may come from noise whose density rises towards a harmonic
_RANK = 1e-6


@dataclass(frozen=True)
class Drift:
    """A slow change of the beat: ``ratio`` of its power to that of noise, ``probability`` of that for noise alone.

    ``size``: its root mean square beyond the noise, over all samples and channels, m or N.
    """

    ratio: float
    probability: float
    size: float

    @property
    def found(self) -> bool:
        """Whether noise alone does not explain the change."""
        return self.probability < CERTAIN and self.ratio > LEAST_RATIO


def drift_of(
    scatter: Float[Array, "T C"],
    valid: Bool[Mask, "T C"],
    psi: Float[Array, " T"],
    apparent: Float[Array, " T"],
    harmonics: int,
    beats: int,
) -> Drift | None:
    """Compare the linear change of the first harmonics with the noise around them; None with too few beats.

    ``scatter`` [T, C]: recorded values minus mean beat, zero where not ``valid``; ``psi`` [T]: phase (rad) of the beat,
    ``apparent`` [T]: time in apparent beats; ``harmonics``: of the mean beat; ``beats``: whole apparent beats.
    """
    if beats < FEWEST_BEATS:
        return None
    values = scatter[:, valid.any(axis=0)]
    periodic, lines = _orthonormal(fourier_basis(psi, harmonics)), np.arange(1, beats // 2 + 1) / beats
    count = min(HARMONICS, harmonics)
    changes = [_orthonormal(_slow(psi, k, curved=False), periodic) for k in range(1, count + 1)]
    all_changes = _orthonormal(np.hstack(changes))
    slow, noise, freedom = [], [], 0
    for k, change in enumerate(changes, 1):
        angles = 2 * np.pi * apparent[:, None] * np.concatenate([k - lines, k + lines])
        around = _orthonormal(np.hstack([np.cos(angles), np.sin(angles)]), periodic, all_changes)
        slow.append(((change.T @ values) ** 2).mean(axis=0))
        noise.append(((around.T @ values) ** 2).mean(axis=0))
        freedom += around.shape[1]
    # Size of each channel, so that a loud one does not decide alone; from all samples, to hardly depend on ``noise``.
    scale = np.maximum((values**2).sum(axis=0) - ((all_changes.T @ values) ** 2).sum(axis=0), 1e-300)
    ratio = float((np.array(slow) / scale).mean() / max(float((np.array(noise) / scale).mean()), 1e-300))
    independent = _independent(values)
    probability = float(stats.f.sf(ratio, 2 * count * independent, freedom * independent))
    power = 2.0 * float(np.sum(slow)) * max(0.0, 1.0 - 1.0 / max(ratio, 1.0))
    return Drift(ratio, probability, float(np.sqrt(power / valid.sum())))


def slow_basis(psi: Float[Array, " T"], beats: int, harmonics: int) -> tuple[Float[Array, "T P"], Int[Index, " P"]]:
    """Slow changes of mean and first harmonics, as columns [T, P], and the harmonic [P] of each.

    Linear changes and, in long recordings, curved ones.
    """
    curved = beats >= LONG
    count = min(HARMONICS, harmonics)
    columns = [_slow(psi, k, curved=curved) for k in range(count + 1)]
    return np.hstack(columns), np.repeat(np.arange(count + 1), [part.shape[1] for part in columns])


def _slow(psi: Array, k: int, *, curved: bool) -> Array:
    """Slow changes [T, .] of harmonic ``k`` (0: of the mean): Legendre polynomials of the time."""
    time = np.linspace(-1.0, 1.0, len(psi))[:, None]
    slow = np.hstack([time, 1.5 * time**2 - 0.5]) if curved else time
    return np.hstack([slow * np.cos(k * psi)[:, None], slow * np.sin(k * psi)[:, None]]) if k else slow


def _orthonormal(columns: Array, *others: Array) -> Array:
    """Return an orthonormal basis of the part of ``columns`` [T, .] that is orthogonal to the ``others``."""
    for other in others:
        columns = columns - other @ (other.T @ columns)
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(basis[:, sizes > _RANK * sizes.max(initial=0.0)])


def _independent(values: Array) -> float:
    """Number of independent channels that scatter like ``values`` [T, C]: fewer than C where they scatter together."""
    covariance = values.T @ values
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return float(len(size) ** 2 / max(float(((covariance / size / size[:, None]) ** 2).sum()), 1.0))
